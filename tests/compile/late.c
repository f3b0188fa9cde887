/* The interfaces first, as another header of a user may include them; the implementations later in the same file. */
#include "isogi_trace.h"
#include "isogi_dvr.h"
#define ISOGI_IMPLEMENTATION
#include "isogi_sh.h"
#include "isogi_trace.h"
#include "isogi_vol.h"
#include "isogi_dvr.h"
extern int isogi_compile_late;
