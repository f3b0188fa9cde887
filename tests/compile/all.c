/* Every header together, the ones that need others first, each twice. */
#include "isogi_dvr.h"
#include "isogi_trace.h"
#include "isogi_vol.h"
#include "isogi_sh.h"
#include "isogi_dvr.h"
#include "isogi_trace.h"
extern int isogi_compile_all;
