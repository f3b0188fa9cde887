/* One header alone: cc -DHEADER='"isogi_vol.h"' [-DISOGI_IMPLEMENTATION] -c one.c */
#include HEADER
#include HEADER
extern int isogi_compile_one;
