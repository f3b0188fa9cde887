/* Draws a table of benchmarks: run time against error, both logarithmic, one panel for each case with several settings; cases with
   one setting as a table below. Left is more exact, down is faster. Settings "order N" stand at their order instead of their time.

       build/bench/plot IN.csv OUT.svg      columns header,case,method,setting,seconds,error,work,unit */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { MOST_ROWS = 4096, MOST_METHODS = 8, COLUMNS = 3, PANEL_W = 420, PANEL_H = 330, MARGIN = 28, LINE_H = 22 };
enum { LEFT = 58, RIGHT = 20, TOP = 62, BOTTOM = 46 }; /* within a panel, around the plot */

typedef struct row {
    char header[64], name[96], method[64], setting[128], unit[32];
    double seconds, error, work;
} row;

static row rows[MOST_ROWS];
static int row_count;
static FILE *svg;

/* Ink of methods, told apart by the colour-blind too (Okabe and Ito); the default comes first. */
static const char *const colours[MOST_METHODS] = {"#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#7f7f7f", "#000000"};

static void put(const char *text) { /* as XML */
    for (; *text; text++) {
        if (*text == '&') fputs("&amp;", svg);
        else if (*text == '<') fputs("&lt;", svg);
        else if (*text == '>') fputs("&gt;", svg);
        else fputc(*text, svg);
    }
}

static void text(double x, double y, const char *style, const char *words) {
    fprintf(svg, "<text x=\"%.1f\" y=\"%.1f\" %s>", x, y, style);
    put(words);
    fputs("</text>\n", svg);
}

/* ---- the table ---- */

static int read_rows(const char *path) {
    char line[1024];
    FILE *file = fopen(path, "r");
    if (!file) return 0;
    while (fgets(line, sizeof line, file) && row_count < MOST_ROWS) {
        char *field[8], *at = line;
        int n = 0;
        line[strcspn(line, "\r\n")] = 0;
        for (; n < 8; n++) {
            field[n] = at;
            at = strchr(at, ',');
            if (!at) { n++; break; }
            *at++ = 0;
        }
        if (n != 8 || !strcmp(field[0], "header")) continue;
        row *r = &rows[row_count++];
        snprintf(r->header, sizeof r->header, "%s", field[0]);
        snprintf(r->name, sizeof r->name, "%s", field[1]);
        snprintf(r->method, sizeof r->method, "%s", field[2]);
        snprintf(r->setting, sizeof r->setting, "%s", field[3]);
        snprintf(r->unit, sizeof r->unit, "%s", field[7]);
        r->seconds = atof(field[4]), r->error = atof(field[5]), r->work = atof(field[6]);
    }
    fclose(file);
    return 1;
}

static int points_of(const char *name) {
    int n = 0;
    for (int i = 0; i < row_count; i++) n += !strcmp(rows[i].name, name) && rows[i].seconds > 0;
    return n;
}

static int is_first(int i) {
    for (int k = 0; k < i; k++)
        if (!strcmp(rows[k].name, rows[i].name)) return 0;
    return 1;
}

static void rate_text(const row *r, char *out, size_t size) {
    double rate = r->seconds > 0 ? r->work / r->seconds : 0;
    if (rate >= 1e6) snprintf(out, size, "%.3g M %s/s", rate / 1e6, r->unit);
    else if (rate >= 1e3) snprintf(out, size, "%.3g k %s/s", rate / 1e3, r->unit);
    else snprintf(out, size, "%.3g %s/s", rate, r->unit);
}

static void seconds_text(double s, char *out, size_t size) {
    if (s >= 1) snprintf(out, size, "%.3g s", s);
    else if (s >= 1e-3) snprintf(out, size, "%.3g ms", s * 1e3);
    else snprintf(out, size, "%.3g µs", s * 1e6);
}

/* ---- one panel ---- */

typedef struct axis {
    double low, high; /* powers of ten */
    double from, to;  /* pixels */
} axis;

typedef struct box { double x0, y0, x1, y1; } box;

static double place(const axis *a, double value) { return a->from + (log10(value) - a->low) / (a->high - a->low) * (a->to - a->from); }

/* A range of values as powers of ten with some room, at least a decade wide. */
static axis axis_of(double low, double high, double from, double to) {
    axis a = {log10(low) - 0.15, log10(high) + 0.15, from, to};
    double middle = (a.low + a.high) / 2;
    if (a.high - a.low < 1.2) a.low = middle - 0.6, a.high = middle + 0.6;
    return a;
}

/* digit * 10^power, as a decimal where that is short, else with the exponent set high */
static void number(double x, double y, const char *anchor, int power, int digit) {
    static const char *const high[10] = {"⁰", "¹", "²", "³", "⁴", "⁵", "⁶", "⁷", "⁸", "⁹"};
    char style[80], words[64];
    snprintf(style, sizeof style, "class=\"tick\" text-anchor=\"%s\"", anchor);
    if (power >= -3 && power <= 3) snprintf(words, sizeof words, "%g", digit * pow(10, power));
    else {
        int n = digit == 1 ? snprintf(words, sizeof words, "10") : snprintf(words, sizeof words, "%d·10", digit), size = abs(power);
        if (power < 0) n += snprintf(words + n, sizeof words - (size_t)n, "⁻");
        if (size > 9) n += snprintf(words + n, sizeof words - (size_t)n, "%s", high[size / 10 % 10]);
        snprintf(words + n, sizeof words - (size_t)n, "%s", high[size % 10]);
    }
    text(x, y, style, words);
}

/* Grid lines and numbers at 1, and at 2 and 5 where there is room. */
static void ticks(const axis *a, int vertical, double other0, double other1) {
    int every = (int)ceil((a->high - a->low) / 6); /* decades between numbers where there are many */
    for (int power = (int)floor(a->low); power <= (int)ceil(a->high); power++)
        for (int digit = 1; digit <= 9; digit++) {
            double l = power + log10(digit), at = a->from + (l - a->low) / (a->high - a->low) * (a->to - a->from);
            int named = digit == 1 ? power % every == 0 : (digit == 2 || digit == 5) && a->high - a->low < 2.2;
            if (l < a->low || l > a->high || (digit > 1 && a->high - a->low > 4)) continue;
            if (vertical) fprintf(svg, "<path class=\"%s\" d=\"M%.1f %.1fH%.1f\"/>\n", digit == 1 ? "grid" : "fine", other0, at, other1);
            else fprintf(svg, "<path class=\"%s\" d=\"M%.1f %.1fV%.1f\"/>\n", digit == 1 ? "grid" : "fine", at, other0, other1);
            if (!named) continue;
            if (vertical) number(other0 - 7, at + 3.5, "end", power, digit);
            else number(at, other1 + 16, "middle", power, digit);
        }
}

static int overlaps(const box *boxes, int count, const box *b) {
    for (int i = 0; i < count; i++)
        if (b->x0 < boxes[i].x1 && b->x1 > boxes[i].x0 && b->y0 < boxes[i].y1 && b->y1 > boxes[i].y0) return 1;
    return 0;
}

/* Puts a setting beside its point where nothing else stands; nowhere rather than on top of something. */
static void label(double x, double y, const char *words, const char *colour, const box *frame, box *taken, int *count) {
    static const double shift[8][2] = {{8, -6}, {-8, 14}, {8, 14}, {-8, -6}, {8, 4}, {-8, 4}, {0, -11}, {0, 19}};
    char shown[40], style[120];
    double width;
    snprintf(shown, sizeof shown, "%.30s", words);
    if (strchr(shown, ';')) *strchr(shown, ';') = 0;
    width = 5.4 * (double)strlen(shown);
    for (int k = 0; k < 8; k++) {
        double tx = x + shift[k][0], ty = y + shift[k][1], left = shift[k][0] > 0 ? 0 : shift[k][0] < 0 ? width : width / 2;
        box b = {tx - left - 1, ty - 9, tx - left + width + 1, ty + 2};
        if (b.x0 < frame->x0 || b.x1 > frame->x1 || b.y0 < frame->y0 || b.y1 > frame->y1 || overlaps(taken, *count, &b)) continue;
        taken[(*count)++] = b;
        snprintf(style, sizeof style, "class=\"label\" fill=\"%s\" text-anchor=\"%s\"", colour,
                 shift[k][0] > 0   ? "start"
                 : shift[k][0] < 0 ? "end"
                                   : "middle");
        text(tx, ty, style, shown);
        return;
    }
}

/* What stands upright: seconds, or the order where the settings are "order N", for curves of convergence. */
static double height(const row *r) {
    int order;
    return sscanf(r->setting, "order %d", &order) == 1 && order > 0 ? order : r->seconds;
}

static int compare_rows(const void *a, const void *b) {
    const row *x = *(const row *const *)a, *y = *(const row *const *)b;
    return x->error != y->error ? (x->error > y->error) - (x->error < y->error) : (x->seconds > y->seconds) - (x->seconds < y->seconds);
}

static int methods_of(const char *name, const char **method) {
    int n = 0;
    for (int i = 0; i < row_count; i++) {
        int known = strcmp(rows[i].name, name) != 0 || !(rows[i].seconds > 0);
        for (int m = 0; m < n && !known; m++) known = !strcmp(method[m], rows[i].method);
        if (known || n == MOST_METHODS) continue;
        method[n++] = rows[i].method;
        if (!strcmp(rows[i].method, "default")) method[n - 1] = method[0], method[0] = rows[i].method;
    }
    return n;
}

/* The rows of one case by method and error; their number. */
static int pick(const char *name, const char *method, const row **out) {
    int n = 0;
    for (int i = 0; i < row_count; i++)
        if (!strcmp(rows[i].name, name) && !strcmp(rows[i].method, method) && rows[i].seconds > 0) out[n++] = &rows[i];
    qsort(out, (size_t)n, sizeof *out, compare_rows);
    return n;
}

/* Left to right: a strip for error 0 where there is one, then the logarithmic axis. */
static void panel_axes(const char *name, const box *frame, axis *x, axis *y, int *zeros) {
    double e0 = 1e300, e1 = 0, s0 = 1e300, s1 = 0;
    *zeros = 0;
    for (int i = 0; i < row_count; i++) {
        if (strcmp(rows[i].name, name) != 0 || !(rows[i].seconds > 0)) continue;
        s0 = fmin(s0, height(&rows[i])), s1 = fmax(s1, height(&rows[i]));
        if (rows[i].error > 0) e0 = fmin(e0, rows[i].error), e1 = fmax(e1, rows[i].error);
        else *zeros = 1;
    }
    if (!(e1 > 0)) e0 = e1 = 1e-3; /* all exact: the axis is there for its strip alone */
    *x = axis_of(e0, e1, frame->x0 + (*zeros ? 34 : 0), frame->x1);
    *y = axis_of(s0, s1, frame->y1, frame->y0);
}

static void panel(const char *name, double left, double top) {
    const box frame = {left + LEFT, top + TOP, left + PANEL_W - RIGHT, top + PANEL_H - BOTTOM};
    const char *method[MOST_METHODS];
    const row *picked[MOST_ROWS];
    static box taken[2 * MOST_ROWS];
    int zeros, count = 0, methods = methods_of(name, method);
    double legend = left + LEFT;
    axis x, y;
    panel_axes(name, &frame, &x, &y, &zeros);
    fprintf(svg, "<rect class=\"card\" x=\"%.1f\" y=\"%.1f\" width=\"%d\" height=\"%d\" rx=\"8\"/>\n", left + 4, top + 4, PANEL_W - 8,
            PANEL_H - 8);
    text(left + LEFT, top + 30, "class=\"name\"", name);
    ticks(&x, 0, frame.y0, frame.y1);
    ticks(&y, 1, frame.x0, frame.x1);
    if (zeros) {
        fprintf(svg, "<path class=\"axis\" d=\"M%.1f %.1fV%.1f\"/>\n", x.from - 4, frame.y0, frame.y1);
        text(frame.x0 + 15, frame.y1 + 16, "class=\"tick\" text-anchor=\"middle\"", "0");
    }
    fprintf(svg, "<path class=\"axis\" d=\"M%.1f %.1fV%.1fH%.1f\"/>\n", frame.x0, frame.y0, frame.y1, frame.x1);
    text((frame.x0 + frame.x1) / 2, frame.y1 + 34, "class=\"tick\" text-anchor=\"middle\"", "error");
    fprintf(svg, "<text class=\"tick\" text-anchor=\"middle\" transform=\"translate(%.1f %.1f) rotate(-90)\">%s</text>\n", left + 18,
            (frame.y0 + frame.y1) / 2, y.high > log10(2) && strstr(name, "truncation") ? "order" : "seconds");
    for (int m = 0; m < methods; m++) { /* every point keeps its own place free before any label is put */
        int n = pick(name, method[m], picked);
        for (int i = 0; i < n; i++) {
            double px = picked[i]->error > 0 ? place(&x, picked[i]->error) : frame.x0 + 15, py = place(&y, height(picked[i]));
            taken[count++] = (box){px - 4, py - 4, px + 4, py + 4};
        }
    }
    for (int m = methods - 1; m >= 0; m--) {
        int n = pick(name, method[m], picked), pen = 0;
        fprintf(svg, "<path class=\"curve\" stroke=\"%s\" stroke-width=\"%s\" d=\"", colours[m], m ? "1.5" : "2.5");
        for (int i = 0; i < n; i++)
            if (picked[i]->error > 0)
                fprintf(svg, "%s%.1f %.1f", pen++ ? "L" : "M", place(&x, picked[i]->error), place(&y, height(picked[i])));
        fputs(pen ? "\"/>\n" : "M0 0\"/>\n", svg);
        for (int i = 0; i < n; i++) {
            double px = picked[i]->error > 0 ? place(&x, picked[i]->error) : frame.x0 + 15, py = place(&y, height(picked[i]));
            char rate[80];
            rate_text(picked[i], rate, sizeof rate);
            fputs("<g><title>", svg);
            put(method[m]), put(", "), put(picked[i]->setting), put(", "), put(rate);
            fprintf(svg, ", %.4g s, error %.4g</title><circle cx=\"%.1f\" cy=\"%.1f\" r=\"%s\" fill=\"%s\"/></g>\n", picked[i]->seconds,
                    picked[i]->error, px, py, m ? "3" : "4", colours[m]);
        }
    }
    for (int m = 0; m < methods; m++) {
        int n = pick(name, method[m], picked);
        for (int i = 0; i < n; i++)
            label(picked[i]->error > 0 ? place(&x, picked[i]->error) : frame.x0 + 15, place(&y, height(picked[i])), picked[i]->setting,
                  colours[m], &frame, taken, &count);
        fprintf(svg, "<circle cx=\"%.1f\" cy=\"%.1f\" r=\"4\" fill=\"%s\"/>\n", legend + 4, top + 45, colours[m]);
        text(legend + 13, top + 49, "class=\"key\"", method[m]);
        legend += 30 + 6.2 * (double)strlen(method[m]);
    }
}

/* ---- the page ---- */

static void single_rows(double top) {
    const double column[6] = {MARGIN + 14, MARGIN + 250, MARGIN + 350, MARGIN + 800, MARGIN + 920, MARGIN + 1140};
    static const char *const head[6] = {"case", "method", "setting", "time", "rate", "error"};
    double y = top + 20;
    for (int c = 0; c < 6; c++) text(column[c], y, "class=\"head\"", head[c]);
    for (int i = 0; i < row_count; i++) {
        char words[80];
        const row *r = &rows[i];
        if (points_of(r->name) != 1 || !(r->seconds > 0)) continue;
        y += LINE_H;
        fprintf(svg, "<path class=\"grid\" d=\"M%d %.1fH%d\"/>\n", MARGIN + 4, y - LINE_H + 7, MARGIN + COLUMNS * PANEL_W - 4);
        text(column[0], y, "class=\"cell\"", r->name);
        text(column[1], y, "class=\"cell\"", r->method);
        text(column[2], y, "class=\"cell\"", r->setting);
        seconds_text(r->seconds, words, sizeof words);
        text(column[3], y, "class=\"cell\"", words);
        rate_text(r, words, sizeof words);
        text(column[4], y, "class=\"cell\"", words);
        snprintf(words, sizeof words, "%.3g", r->error);
        text(column[5], y, "class=\"cell\"", words);
    }
}

static void page(void) {
    int panels = 0, singles = 0, drawn = 0, lines, width = 2 * MARGIN + COLUMNS * PANEL_W, height;
    char title[200];
    for (int i = 0; i < row_count; i++)
        if (is_first(i)) {
            panels += points_of(rows[i].name) > 1;
            singles += points_of(rows[i].name) == 1;
        }
    lines = (panels + COLUMNS - 1) / COLUMNS;
    height = 86 + lines * PANEL_H + (singles ? 30 + (singles + 1) * LINE_H : 0) + MARGIN;
    fprintf(svg,
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"%d\" height=\"%d\" viewBox=\"0 0 %d %d\" "
            "font-family=\"system-ui,Helvetica,Arial,sans-serif\">\n",
            width, height, width, height);
    fputs("<style>.card{fill:#fff;stroke:#dde1e6}.grid{stroke:#e3e6ea;fill:none}.fine{stroke:#f2f4f6;fill:none}.axis{stroke:#8b929a;fill:"
          "none}"
          ".tick{font-size:10.5px;fill:#5a6068}.name{font-size:15px;font-weight:600;fill:#1d2126}.key{font-size:11.5px;fill:#3a4048}"
          ".label{font-size:10px}.curve{fill:none;stroke-linejoin:round;stroke-linecap:round}.title{font-size:22px;font-weight:700;fill:#"
          "1d2126}"
          ".sub{font-size:13px;fill:#5a6068}.head{font-size:11.5px;font-weight:600;fill:#5a6068}.cell{font-size:12.5px;fill:#1d2126}</"
          "style>\n",
          svg);
    fprintf(svg, "<rect width=\"%d\" height=\"%d\" fill=\"#f7f8fa\"/>\n", width, height);
    snprintf(title, sizeof title, "%s: run time against error", row_count ? rows[0].header : "nothing measured");
    text(MARGIN + 4, 40, "class=\"title\"", title);
    text(MARGIN + 4, 64, "class=\"sub\"",
         "Left is more exact, down is faster; both axes logarithmic, one dot for each setting. Rates are work per second.");
    for (int i = 0; i < row_count; i++) {
        if (!is_first(i) || points_of(rows[i].name) < 2) continue;
        panel(rows[i].name, MARGIN + drawn % COLUMNS * PANEL_W, 82 + drawn / COLUMNS * PANEL_H);
        drawn++;
    }
    if (singles) single_rows(82 + lines * PANEL_H + 16);
    fputs("</svg>\n", svg);
}

int main(int argc, char **argv) {
    if (argc != 3) return fprintf(stderr, "usage: plot IN.csv OUT.svg\n"), 2;
    if (!read_rows(argv[1])) return fprintf(stderr, "%s: cannot be read\n", argv[1]), 1;
    if (!row_count) return fprintf(stderr, "%s: holds no row with the eight columns\n", argv[1]), 1;
    svg = fopen(argv[2], "w");
    if (!svg) return fprintf(stderr, "%s: cannot be written\n", argv[2]), 1;
    page();
    if (ferror(svg) | fclose(svg)) return fprintf(stderr, "%s: cannot be written\n", argv[2]), 1;
    printf("%s\n", argv[2]);
    return 0;
}
