/* Any bytes as any file: pictures, transfer functions and the names of volumes either decode or are refused with a message. */
#include "isogi_dvr.h"

#include "hdr.h"
#include "png.h"
#include "transfer_file.h"
#include "volume_file.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    char error[FILE_ERROR_SIZE], *text = (char *)malloc(size + 1);
    hdr_image image;
    transfer_file transfer;
    unsigned char *pixels;
    int shape[3];
    size_t sizes[3];
    isogi_type type;
    if (!text) return 0;
    memcpy(text, data, size), text[size] = 0;
    error[0] = 0;
    if (hdr_decode(data, size, &image, error)) {
        volatile float last = image.rgb[3 * (size_t)image.width * (size_t)image.height - 1];
        (void)last;
        free(image.rgb);
    } else if (!error[0]) abort();
    error[0] = 0;
    if (png_decode(data, size, &pixels, shape, error)) {
        volatile unsigned char last = pixels[(size_t)shape[0] * (size_t)shape[1] * (size_t)shape[2] - 1];
        (void)last;
        free(pixels);
    } else if (!error[0]) abort();
    error[0] = 0;
    if (transfer_parse(text, &transfer, error)) transfer_file_free(&transfer);
    else if (!error[0]) abort();
    error[0] = 0;
    if (!volume_parse_name(text, sizes, &type, error) && !error[0]) abort();
    free(text);
    return 0;
}
