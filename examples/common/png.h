/* png.h - PNG images, 8 bit per channel, RGB or RGBA: a writer that compresses, and a reader for what it writes

   png_encode: filters chosen per row, LZ77 with hash chains, one dynamic Huffman block. png_decode: non-interlaced grey, RGB and
   RGBA of 8 bits, every kind of deflate block, checksums verified. Both work in memory; png_write goes through file_write. */
#ifndef PNG_H
#define PNG_H

#include "files.h"

/* ---- checksums ---------------------------------------------------------------------------------------------------------------- */

static inline uint32_t png_crc(const unsigned char *data, size_t size) {
    uint32_t crc = 0xffffffffu;
    size_t i;
    int k;
    for (i = 0; i < size; i++)
        for (crc ^= data[i], k = 0; k < 8; k++) crc = (crc >> 1) ^ (0xedb88320u & (0u - (crc & 1u)));
    return ~crc;
}

static inline uint32_t png_adler(const unsigned char *data, size_t size) {
    uint32_t a = 1, b = 0;
    size_t i;
    for (i = 0; i < size; i++) a = (a + data[i]) % 65521u, b = (b + a) % 65521u;
    return b << 16 | a;
}

static inline void png_put32(unsigned char *p, uint32_t x) {
    p[0] = (unsigned char)(x >> 24), p[1] = (unsigned char)(x >> 16), p[2] = (unsigned char)(x >> 8), p[3] = (unsigned char)x;
}
static inline uint32_t png_get32(const unsigned char *p) {
    return (uint32_t)p[0] << 24 | (uint32_t)p[1] << 16 | (uint32_t)p[2] << 8 | p[3];
}

/* ---- filters: each byte as a difference from its neighbours (PNG specification, 9) ------------------------------------------------ */

static inline int png_paeth(int a, int b, int c) {
    int p = a + b - c, pa = abs(p - a), pb = abs(p - b), pc = abs(p - c);
    return pa <= pb && pa <= pc ? a : pb <= pc ? b : c;
}

/* a: left, b: above, c: above left */
static inline int png_predict(int filter, int a, int b, int c) {
    switch (filter) {
    case 1: return a;
    case 2: return b;
    case 3: return (a + b) / 2;
    case 4: return png_paeth(a, b, c);
    default: return 0;
    }
}

/* Writes the filter byte and the row; the filter with the least sum of absolute differences wins. */
static inline void png_filter_row(const unsigned char *row, const unsigned char *above, size_t bytes, size_t pixel, unsigned char *out) {
    unsigned long best_sum = 0;
    int filter, best = 0, pass;
    for (pass = 0; pass < 6; pass++) { /* five trials, then the best for good */
        unsigned long sum = 0;
        size_t i;
        filter = pass < 5 ? pass : best;
        for (i = 0; i < bytes; i++) {
            int a = i >= pixel ? row[i - pixel] : 0, b = above ? above[i] : 0, c = above && i >= pixel ? above[i - pixel] : 0;
            unsigned char d = (unsigned char)(row[i] - png_predict(filter, a, b, c));
            out[1 + i] = d;
            sum += (unsigned long)(d < 128 ? d : 256 - d);
        }
        if (pass == 0 || (pass < 5 && sum < best_sum)) best_sum = sum, best = filter;
    }
    out[0] = (unsigned char)best;
}

/* ---- deflate (RFC 1951) ----------------------------------------------------------------------------------------------------------- */

static const unsigned short png_length_base[29] = {3,  4,  5,  6,  7,  8,  9,  10, 11,  13,  15,  17,  19,  23, 27,
                                                   31, 35, 43, 51, 59, 67, 83, 99, 115, 131, 163, 195, 227, 258};
static const unsigned char png_length_bits[29] = {0, 0, 0, 0, 0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3, 4, 4, 4, 4, 5, 5, 5, 5, 0};
static const unsigned short png_distance_base[30] = {1,    2,    3,    4,    5,    7,    9,    13,    17,    25,
                                                     33,   49,   65,   97,   129,  193,  257,  385,   513,   769,
                                                     1025, 1537, 2049, 3073, 4097, 6145, 8193, 12289, 16385, 24577};
static const unsigned char png_distance_bits[30] = {0, 0, 0, 0, 1, 1, 2, 2,  3,  3,  4,  4,  5,  5,  6,
                                                    6, 7, 7, 8, 8, 9, 9, 10, 10, 11, 11, 12, 12, 13, 13};
static const unsigned char png_code_order[19] = {16, 17, 18, 0, 8, 7, 9, 6, 10, 5, 11, 4, 12, 3, 13, 2, 14, 1, 15};

typedef struct png_bits {
    unsigned char *data;
    size_t at; /* bytes written */
    uint32_t buffer;
    int count;
} png_bits;

static inline void png_emit(png_bits *out, uint32_t value, int bits) {
    out->buffer |= value << out->count;
    out->count += bits;
    while (out->count >= 8) out->data[out->at++] = (unsigned char)out->buffer, out->buffer >>= 8, out->count -= 8;
}

/* Huffman code lengths of at most `limit` bits: the plain algorithm on frequencies that are flattened until it fits. n <= 288. */
static inline void png_code_lengths(const uint32_t *frequency, int n, int limit, unsigned char *length) {
    uint64_t weight[576];
    int parent[576], alive[288], i, nodes, live, deepest, flatten;
    for (flatten = 0;; flatten++) {
        for (live = i = 0; i < n; i++) {
            length[i] = 0;
            weight[i] = frequency[i] ? (frequency[i] >> flatten) + 1u : 0;
            if (weight[i]) alive[live++] = i;
        }
        if (live == 1) length[alive[0]] = 1;
        if (live < 2) return;
        for (nodes = n; live > 1; nodes++) {
            int pick, chosen[2];
            for (pick = 0; pick < 2; pick++) {
                int least = 0;
                for (i = 1; i < live; i++)
                    if (weight[alive[i]] < weight[alive[least]]) least = i;
                chosen[pick] = alive[least];
                alive[least] = alive[--live];
            }
            weight[nodes] = weight[chosen[0]] + weight[chosen[1]];
            parent[chosen[0]] = parent[chosen[1]] = nodes;
            alive[live++] = nodes;
        }
        for (deepest = i = 0; i < n; i++) {
            int node, depth = 0;
            if (!frequency[i]) continue;
            for (node = i; node != nodes - 1; node = parent[node]) depth++;
            length[i] = (unsigned char)(depth < 255 ? depth : 255);
            deepest = depth > deepest ? depth : deepest;
        }
        if (deepest <= limit) return;
    }
}

/* Canonical codes, bit-reversed as the stream wants them. */
static inline void png_codes(const unsigned char *length, int n, unsigned short *code) {
    int count[16] = {0}, next[16], i, k, c = 0;
    for (i = 0; i < n; i++) count[length[i]]++;
    count[0] = 0;
    for (i = 1; i < 16; i++) c = (c + count[i - 1]) << 1, next[i] = c;
    for (i = 0; i < n; i++) {
        int value, reversed = 0;
        if (!length[i]) continue;
        value = next[length[i]]++;
        for (k = 0; k < length[i]; k++) reversed |= (value >> k & 1) << (length[i] - 1 - k);
        code[i] = (unsigned short)reversed;
    }
}

static inline int png_symbol(const unsigned short *base, int n, int value) {
    while (n > 1 && base[n - 1] > value) n--;
    return n - 1;
}

/* Tokens: a literal byte, or length << 16 | distance with length >= 3. Returns their number. */
static inline size_t png_tokens(const unsigned char *in, size_t size, uint32_t *token, int32_t *head, int32_t *previous) {
    size_t i = 0, n = 0, k;
    for (k = 0; k < 32768; k++) head[k] = -1;
    while (i < size) {
        size_t best = 0, distance = 0, limit = size - i < 258 ? size - i : 258, skip, end;
        if (limit >= 3) {
            uint32_t hash = ((uint32_t)in[i] << 16 | (uint32_t)in[i + 1] << 8 | in[i + 2]) * 2654435761u >> 17;
            int32_t at = head[hash];
            int tries = 32;
            for (; at >= 0 && i - (size_t)at <= 32768 && tries; at = previous[at & 32767], tries--) {
                size_t length = 0;
                while (length < limit && in[(size_t)at + length] == in[i + length]) length++;
                if (length > best) best = length, distance = i - (size_t)at;
                if (best == limit) break;
            }
        }
        if (best < 4 && !(best == 3 && distance < 4096)) best = 0;
        token[n++] = best ? (uint32_t)best << 16 | (uint32_t)distance : in[i];
        skip = best ? best : 1;
        for (end = i + skip; i < end; i++) {
            uint32_t hash;
            if (size - i < 3) continue;
            hash = ((uint32_t)in[i] << 16 | (uint32_t)in[i + 1] << 8 | in[i + 2]) * 2654435761u >> 17;
            previous[i & 32767] = head[hash], head[hash] = (int32_t)i;
        }
    }
    return n;
}

/* The header of a dynamic block: the code lengths of both alphabets, themselves in Huffman code (no run lengths: a few bytes). */
static inline void png_emit_tables(png_bits *out, const unsigned char *length) {
    uint32_t frequency[19] = {0};
    unsigned char meta_length[19];
    unsigned short meta_code[19] = {0};
    int i;
    for (i = 0; i < 316; i++) frequency[length[i]]++;
    png_code_lengths(frequency, 19, 7, meta_length);
    png_codes(meta_length, 19, meta_code);
    png_emit(out, 286 - 257, 5);
    png_emit(out, 30 - 1, 5);
    png_emit(out, 19 - 4, 4);
    for (i = 0; i < 19; i++) png_emit(out, meta_length[png_code_order[i]], 3);
    for (i = 0; i < 316; i++) png_emit(out, meta_code[length[i]], meta_length[length[i]]);
}

/* One dynamic block into out, which must have room for 2 * size + 1024 bytes; 0 when memory runs out. */
static inline int png_deflate(const unsigned char *in, size_t size, png_bits *out) {
    uint32_t *token = (uint32_t *)malloc((size + 1) * sizeof *token), frequency[316] = {0};
    int32_t *chain = (int32_t *)malloc(65536 * sizeof *chain);
    unsigned char length[316];
    unsigned short code[316] = {0};
    size_t n, i;
    if (!token || !chain) {
        free(token), free(chain);
        return 0;
    }
    n = png_tokens(in, size, token, chain, chain + 32768);
    for (i = 0; i < n; i++) {
        if (token[i] < 65536) frequency[token[i]]++;
        else {
            frequency[257 + png_symbol(png_length_base, 29, (int)(token[i] >> 16))]++;
            frequency[286 + png_symbol(png_distance_base, 30, (int)(token[i] & 65535))]++;
        }
    }
    frequency[256] = 1;
    frequency[286]++; /* an alphabet may not be empty */
    png_code_lengths(frequency, 286, 15, length);
    png_code_lengths(frequency + 286, 30, 15, length + 286);
    png_codes(length, 286, code);
    png_codes(length + 286, 30, code + 286);
    png_emit(out, 1 | 2 << 1, 3); /* last block, dynamic */
    png_emit_tables(out, length);
    for (i = 0; i < n; i++) {
        int l, d;
        if (token[i] < 65536) {
            png_emit(out, code[token[i]], length[token[i]]);
            continue;
        }
        l = png_symbol(png_length_base, 29, (int)(token[i] >> 16)), d = png_symbol(png_distance_base, 30, (int)(token[i] & 65535));
        png_emit(out, code[257 + l], length[257 + l]);
        png_emit(out, (token[i] >> 16) - png_length_base[l], png_length_bits[l]);
        png_emit(out, code[286 + d], length[286 + d]);
        png_emit(out, (token[i] & 65535) - png_distance_base[d], png_distance_bits[d]);
    }
    png_emit(out, code[256], length[256]);
    png_emit(out, 0, 7); /* to the end of the byte */
    free(token), free(chain);
    return 1;
}

/* ---- encoding ---------------------------------------------------------------------------------------------------------------------- */

static inline void png_chunk(unsigned char *p, const char *type, size_t size) {
    png_put32(p, (uint32_t)size);
    memcpy(p + 4, type, 4);
    png_put32(p + 8 + size, png_crc(p + 4, size + 4));
}

/* pixels[height][width][channels], channels 3 or 4, sRGB. The caller frees *data. 0 when memory runs out or the image is too large. */
static inline int png_encode(const unsigned char *pixels, int width, int height, int channels, unsigned char **data, size_t *size) {
    static const unsigned char signature[8] = {137, 80, 78, 71, 13, 10, 26, 10};
    size_t row = (size_t)width * (size_t)channels, raw = (row + 1) * (size_t)height, y;
    unsigned char *filtered, *file, *p;
    png_bits out;
    if (width < 1 || height < 1 || row > ((size_t)1 << 30) / (size_t)height) return 0;
    filtered = (unsigned char *)malloc(raw);
    file = (unsigned char *)malloc(2 * raw + 4096);
    if (!filtered || !file) {
        free(filtered), free(file);
        return 0;
    }
    for (y = 0; y < (size_t)height; y++)
        png_filter_row(pixels + y * row, y ? pixels + (y - 1) * row : NULL, row, (size_t)channels, filtered + y * (row + 1));
    memcpy(file, signature, 8);
    p = file + 8;
    png_put32(p + 8, (uint32_t)width), png_put32(p + 12, (uint32_t)height);
    p[16] = 8, p[17] = channels == 4 ? 6 : 2, p[18] = p[19] = p[20] = 0;
    png_chunk(p, "IHDR", 13), p += 25;
    p[8] = 0; /* rendering intent: perceptual */
    png_chunk(p, "sRGB", 1), p += 13;
    memset(&out, 0, sizeof out);
    out.data = p + 8;
    png_emit(&out, 0x0178, 16); /* zlib: deflate, 32 KiB window */
    if (!png_deflate(filtered, raw, &out)) {
        free(filtered), free(file);
        return 0;
    }
    png_put32(p + 8 + out.at, png_adler(filtered, raw));
    png_chunk(p, "IDAT", out.at + 4), p += 12 + out.at + 4;
    png_chunk(p, "IEND", 0), p += 12;
    free(filtered);
    *data = file;
    *size = (size_t)(p - file);
    return 1;
}

static inline int png_write(const char *path, const unsigned char *pixels, int width, int height, int channels, char *error) {
    unsigned char *data;
    size_t size;
    int ok;
    if (!png_encode(pixels, width, height, channels, &data, &size)) return file_fail(error, "%s: out of memory", path);
    ok = file_write(path, data, size, error);
    free(data);
    return ok;
}

/* ---- decoding ---------------------------------------------------------------------------------------------------------------------- */

typedef struct png_source {
    const unsigned char *data;
    size_t size, at;
    uint32_t buffer;
    int count, broken; /* broken: read beyond the end, or a code that does not exist */
} png_source;

static inline uint32_t png_take(png_source *in, int bits) {
    uint32_t value;
    while (in->count < bits) {
        if (in->at >= in->size) {
            in->broken = 1;
            return 0;
        }
        in->buffer |= (uint32_t)in->data[in->at++] << in->count, in->count += 8;
    }
    value = in->buffer & ((1u << bits) - 1u);
    in->buffer >>= bits, in->count -= bits;
    return value;
}

typedef struct png_huffman {
    short count[16], symbol[288];
} png_huffman;

static inline int png_huffman_build(png_huffman *h, const unsigned char *length, int n) {
    short offset[16];
    int i, left = 1;
    memset(h->count, 0, sizeof h->count);
    for (i = 0; i < n; i++) h->count[length[i]]++;
    h->count[0] = 0;
    for (i = 1; i < 16; i++)
        if ((left = 2 * left - h->count[i]) < 0) return 0; /* more codes than there are */
    for (offset[1] = 0, i = 1; i < 15; i++) offset[i + 1] = (short)(offset[i] + h->count[i]);
    for (i = 0; i < n; i++)
        if (length[i]) h->symbol[offset[length[i]]++] = (short)i;
    return 1;
}

static inline int png_huffman_take(png_source *in, const png_huffman *h) {
    int code = 0, first = 0, index = 0, bits;
    for (bits = 1; bits < 16 && !in->broken; bits++) {
        code |= (int)png_take(in, 1);
        if (code - first < h->count[bits]) return h->symbol[index + code - first];
        index += h->count[bits], first = (first + h->count[bits]) << 1, code <<= 1;
    }
    in->broken = 1;
    return 256;
}

static inline int png_read_tables(png_source *in, png_huffman *literal, png_huffman *distance) {
    unsigned char length[320];
    png_huffman meta;
    int literals = (int)png_take(in, 5) + 257, distances = (int)png_take(in, 5) + 1, codes = (int)png_take(in, 4) + 4, i;
    memset(length, 0, sizeof length);
    for (i = 0; i < codes; i++) length[png_code_order[i]] = (unsigned char)png_take(in, 3);
    if (literals > 286 || distances > 30 || !png_huffman_build(&meta, length, 19)) return 0;
    for (i = 0; i < literals + distances && !in->broken;) {
        int symbol = png_huffman_take(in, &meta), repeat = 1, value = symbol;
        if (symbol == 16) {
            if (!i) return 0;
            value = length[i - 1], repeat = 3 + (int)png_take(in, 2);
        } else if (symbol == 17) value = 0, repeat = 3 + (int)png_take(in, 3);
        else if (symbol == 18) value = 0, repeat = 11 + (int)png_take(in, 7);
        if (symbol > 18 || i + repeat > literals + distances) return 0;
        while (repeat--) length[i++] = (unsigned char)value;
    }
    return !in->broken && png_huffman_build(literal, length, literals) && png_huffman_build(distance, length + literals, distances);
}

static inline int png_inflate_codes(png_source *in, const png_huffman *literal, const png_huffman *distance, unsigned char *out,
                                    size_t size, size_t *at) {
    for (;;) {
        int symbol = png_huffman_take(in, literal), d;
        size_t length, back;
        if (in->broken) return 0;
        if (symbol == 256) return 1;
        if (symbol < 256) {
            if (*at >= size) return 0;
            out[(*at)++] = (unsigned char)symbol;
            continue;
        }
        if (symbol > 285) return 0;
        length = png_length_base[symbol - 257] + png_take(in, png_length_bits[symbol - 257]);
        d = png_huffman_take(in, distance);
        if (in->broken || d > 29) return 0;
        back = png_distance_base[d] + png_take(in, png_distance_bits[d]);
        if (in->broken || back > *at || length > size - *at) return 0;
        while (length--) out[*at] = out[*at - back], (*at)++;
    }
}

static inline int png_inflate(png_source *in, unsigned char *out, size_t size) {
    size_t at = 0;
    int last;
    do {
        png_huffman literal, distance;
        unsigned char length[320];
        uint32_t kind;
        last = (int)png_take(in, 1), kind = png_take(in, 2);
        if (in->broken || kind == 3) return 0;
        if (kind == 0) {
            size_t n, complement;
            in->buffer = 0, in->count = 0;
            if (in->size - in->at < 4) return 0;
            n = (size_t)in->data[in->at] | (size_t)in->data[in->at + 1] << 8;
            complement = (size_t)in->data[in->at + 2] | (size_t)in->data[in->at + 3] << 8;
            in->at += 4;
            if ((n ^ complement) != 65535 || n > in->size - in->at || n > size - at) return 0;
            memcpy(out + at, in->data + in->at, n);
            at += n, in->at += n;
            continue;
        }
        if (kind == 1) {
            memset(length, 8, 144), memset(length + 144, 9, 112), memset(length + 256, 7, 24), memset(length + 280, 8, 8);
            png_huffman_build(&literal, length, 288);
            memset(length, 5, 30);
            png_huffman_build(&distance, length, 30);
        } else if (!png_read_tables(in, &literal, &distance)) return 0;
        if (!png_inflate_codes(in, &literal, &distance, out, size, &at)) return 0;
    } while (!last);
    return at == size;
}

/* Joins the IDAT chunks into `stream` (as large as the file) and reads the header. */
static inline int png_read_chunks(const unsigned char *file, size_t size, unsigned char *stream, size_t *used, int shape[3], char *error) {
    size_t at = 8;
    int channels = 0;
    *used = 0;
    if (size < 8 || memcmp(file, "\x89PNG\r\n\x1a\n", 8)) return file_fail(error, "is not a PNG file");
    for (;;) {
        size_t length;
        const unsigned char *type = file + at + 4, *body = file + at + 8;
        if (size - at < 12 || (length = png_get32(file + at)) > size - at - 12) return file_fail(error, "ends in the middle");
        if (png_crc(type, length + 4) != png_get32(body + length)) return file_fail(error, "has a chunk with a wrong checksum");
        at += 12 + length;
        if (!memcmp(type, "IEND", 4)) return channels ? 1 : file_fail(error, "has no header");
        if (!memcmp(type, "IDAT", 4)) memcpy(stream + *used, body, length), *used += length;
        if (memcmp(type, "IHDR", 4)) continue;
        if (length != 13) return file_fail(error, "has a damaged header");
        channels = body[9] == 0 ? 1 : body[9] == 2 ? 3 : body[9] == 6 ? 4 : 0;
        if (!channels || body[8] != 8 || body[10] || body[11] || body[12])
            return file_fail(error, "is a kind of PNG that is not read here (8-bit grey, RGB and RGBA without interlacing are)");
        if (png_get32(body) - 1u >= 32768 || png_get32(body + 4) - 1u >= 32768) return file_fail(error, "is larger than 32768 pixels");
        shape[0] = (int)png_get32(body), shape[1] = (int)png_get32(body + 4), shape[2] = channels;
    }
}

/* pixels[height][width][channels]; shape: width, height, channels. The caller frees *pixels. */
static inline int png_decode(const unsigned char *file, size_t size, unsigned char **pixels, int shape[3], char *error) {
    unsigned char *stream = (unsigned char *)malloc(size + 1), *raw = NULL, *out = NULL;
    size_t used, row, y, i;
    png_source in;
    int ok, found[3] = {0, 0, 0};
    ok = stream ? png_read_chunks(file, size, stream, &used, found, error) : file_fail(error, "out of memory");
    if (!ok) {
        free(stream);
        return 0;
    }
    row = (size_t)found[0] * (size_t)found[2];
    /* deflate packs at most 1032 to 1: a small file that claims a huge image is broken, and must not cost the memory */
    if ((row + 1) * (size_t)found[1] / 1100 > used) ok = file_fail(error, "is damaged");
    if (ok) raw = (unsigned char *)malloc((row + 1) * (size_t)found[1]), out = (unsigned char *)malloc(row * (size_t)found[1]);
    if (ok && (!raw || !out)) ok = file_fail(error, "out of memory");
    memset(&in, 0, sizeof in);
    in.data = stream, in.size = used, in.at = 2;
    if (ok && (used < 6 || !png_inflate(&in, raw, (row + 1) * (size_t)found[1]) || in.size - in.at < 4 ||
               png_get32(stream + in.at) != png_adler(raw, (row + 1) * (size_t)found[1])))
        ok = file_fail(error, "is damaged");
    for (y = 0; ok && y < (size_t)found[1]; y++) {
        const unsigned char *from = raw + y * (row + 1);
        unsigned char *to = out + y * row, *above = y ? to - row : NULL;
        size_t pixel = (size_t)found[2];
        if (from[0] > 4) {
            ok = file_fail(error, "is damaged");
            break;
        }
        for (i = 0; i < row; i++) {
            int a = i >= pixel ? to[i - pixel] : 0, b = above ? above[i] : 0, c = above && i >= pixel ? above[i - pixel] : 0;
            to[i] = (unsigned char)(from[1 + i] + png_predict(from[0], a, b, c));
        }
    }
    free(stream), free(raw);
    if (!ok) {
        free(out);
        return 0;
    }
    *pixels = out;
    memcpy(shape, found, sizeof found);
    return 1;
}

#endif /* PNG_H */
