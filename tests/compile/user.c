/* A user of every header who implements none of them: linked with whoever does, as C and as C++. */
#include "isogi_dvr.h"
#include "isogi_trace.h"
#include <stdio.h>

int main(void) {
    static float data[8][8][8];
    static const float up[1][3] = {{0, 1, 0}};
    float y[4];
    isogi_volume volume;
    isogi_pyramid *pyramid = NULL;
    isogi_ray ray;
    isogi_hit hit;
    isogi_trace_desc trace_desc;
    isogi_trace *trace = NULL;
    isogi_dvr_desc dvr_desc;
    isogi_dvr *dvr = NULL;
    char *zero[] = {(char *)&volume, (char *)&ray, (char *)&trace_desc, (char *)&dvr_desc};
    size_t size[] = {sizeof volume, sizeof ray, sizeof trace_desc, sizeof dvr_desc}, i, k;
    for (i = 0; i < 4; i++)
        for (k = 0; k < size[i]; k++) zero[i][k] = 0;
    for (i = 0; i < 512; i++) data[i / 64][i / 8 % 8][i % 8] = (float)(i % 8);
    volume.data = data, volume.type = ISOGI_F32;
    volume.size[0] = volume.size[1] = volume.size[2] = 8;
    ray.origin[0] = 7, ray.origin[1] = ray.origin[2] = 3, ray.dir[0] = -1, ray.isovalue = 2.5;
    if (isogi_sh_eval(y, 2, up, 1) != ISOGI_OK) return 1;
    if (isogi_vol_build(&pyramid, &volume, NULL) != ISOGI_OK) return 2;
    if (isogi_vol_intersect(pyramid, &ray, 1, &hit, NULL) != ISOGI_OK || !hit.side) return 3;
    /* empty descriptions are refused, which is all that linking needs to know */
    if (isogi_trace_create(&trace, &trace_desc, NULL) == ISOGI_OK) return 4;
    if (isogi_dvr_create(&dvr, &dvr_desc, NULL) == ISOGI_OK) return 5;
    printf("linked: Y1 %g, t %g\n", (double)y[1], hit.t);
    isogi_vol_free(pyramid);
    return 0;
}
