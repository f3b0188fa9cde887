/* Any bytes as a saved texture: refused, or loaded into one that can be read and baked on. Half of the inputs are taken as changes of
   a good block, with its hash mended, so that what lies behind the hash is reached, too. */
#define ISOGI_IMPLEMENTATION
#include "isogi_trace.h"

static uint64_t mended(const uint8_t *bytes, size_t count) {
    uint64_t hash = 0xcbf29ce484222325u;
    for (size_t i = 0; i < count; i++) hash = (hash ^ bytes[i]) * 0x100000001b3u;
    return hash;
}

static void read_and_go_on(isogi_trace *t) {
    float points[8][3], light[8][3], error[8], scales[108];
    uint8_t *block;
    size_t size;
    for (int i = 0; i < 8; i++)
        for (int a = 0; a < 3; a++) points[i][a] = (float)(i >> a & 1 ? 4.3 : 1.7);
    if (isogi_trace_sample(t, (const float(*)[3])points, 8, light, error) != ISOGI_OK) abort();
    if (isogi_trace_export_scales(t, ISOGI_TRACE_BYTE, scales) != ISOGI_OK) abort();
    if (isogi_trace_step(t, 0, NULL) != ISOGI_OK) abort();
    size = isogi_trace_save_size(t);
    block = (uint8_t *)malloc(size);
    if (!block || isogi_trace_save(t, block, size) != ISOGI_OK || isogi_trace_load(t, block, size) != ISOGI_OK) abort();
    free(block);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    static float voxels[216];
    static const float sky[3] = {1, 1, 1};
    isogi_volume volume = {.data = voxels, .type = ISOGI_F32, .size = {6, 6, 6}};
    isogi_context context = {.threads = 1};
    isogi_pyramid *pyramid = NULL;
    isogi_trace *t = NULL;
    isogi_trace_desc desc = {.lighting = {.env = {.sh = sky, .sh_order = 1}}, .samples = 1, .albedo = {0.5f, 0.5f, 0.5f}};
    for (int i = 0; i < 216; i++) voxels[i] = (float)(i * 7 % 5);
    if (!size || isogi_vol_build(&pyramid, &volume, &context) != ISOGI_OK) return 0;
    desc.pyramid = pyramid, desc.storage = (isogi_trace_format)(data[0] >> 1 & 3), desc.lazy = data[0] >> 3 & 1;
    if (data[0] & 16 && desc.storage != ISOGI_TRACE_RGB9E5) desc.mode = ISOGI_TRACE_TRANSFER, desc.order = 2;
    if (data[0] & 32) desc.sides = ISOGI_TRACE_BOTH_SIDES;
    if (isogi_trace_create(&t, &desc, NULL) != ISOGI_OK) abort();
    if (data[0] & 1) {
        isogi_result result = isogi_trace_load(t, data + 1, size - 1);
        if (result == ISOGI_OK) read_and_go_on(t);
        else if (result != ISOGI_CORRUPT && result != ISOGI_INVALID) abort();
    } else {
        isogi_trace *good = NULL;
        desc.sides = ISOGI_TRACE_LOW_SIDE, desc.lazy = 0;
        if (isogi_trace_create(&good, &desc, NULL) != ISOGI_OK || isogi_trace_step(good, 0, NULL) != ISOGI_OK) abort();
        size_t bytes = isogi_trace_save_size(good);
        uint8_t *block = (uint8_t *)malloc(bytes);
        isogi_trace_save(good, block, bytes);
        for (size_t i = 1; i + 2 < size; i += 3) block[(data[i] | data[i + 1] << 8) % (bytes - 8)] = data[i + 2];
        uint64_t hash = mended(block, bytes - 8);
        for (int i = 0; i < 8; i++) block[bytes - 8 + (size_t)i] = (uint8_t)(hash >> 8 * i);
        if (isogi_trace_load(t, block, bytes) == ISOGI_OK) read_and_go_on(t);
        isogi_trace_free(good), free(block);
    }
    isogi_trace_free(t), isogi_vol_free(pyramid);
    return 0;
}
