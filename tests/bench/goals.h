/* The table at the end of a benchmark: what was reached of the goals of the design, 100 % and more where they are met. */
#ifndef GOALS_H
#define GOALS_H

#include <stdio.h>
#include <string.h>

typedef struct goal {
    const char *name; /* case of the default method */
    double value;     /* in seconds, which are to be fewer; else in the unit, of which there are to be more */
    const char *unit; /* NULL: seconds */
    const char *remark;
} goal;

static struct { char name[48]; double value, error; } goals_reached[128];
static int goals_count;

/* What a case reached, in the unit of its goal. */
static void goals_note(const char *name, double value, double error) {
    if (goals_count == 128) return;
    snprintf(goals_reached[goals_count].name, sizeof goals_reached->name, "%s", name);
    goals_reached[goals_count].value = value, goals_reached[goals_count++].error = error;
}

/* Cases that were not run are left out; those of `goal` in its order. */
static void goals_print(const goal *list, size_t count) {
    printf("%-28s %9s %9s %8s  %-16s %s\n", "", "ours", "goal", "of goal", "", "error");
    for (size_t i = 0; i < count; i++)
        for (int k = 0; k < goals_count; k++) {
            double ours = goals_reached[k].value, of = list[i].unit ? ours / list[i].value : list[i].value / ours;
            if (strcmp(goals_reached[k].name, list[i].name)) continue;
            printf("%-28s %9.3g %9.3g %7.0f%%  %-16s %-10.3g %s\n", list[i].name, ours, list[i].value, 100 * of,
                   list[i].unit ? list[i].unit : "s", goals_reached[k].error, list[i].remark ? list[i].remark : "");
        }
}

#endif
