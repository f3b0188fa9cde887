# make           the viewer and the example programs, into build/
# make demo      volume in, globally lit pictures out: build/demo/*.png    (VOLUME=FILE ISO=V for your own)
# make test      the quick tests, under two minutes; ends with "N passed, N failed, N skipped"
# make check     the long suite: full sizes, every compiler and sanitizer that is installed
# make bench     run time against error: build/bench/*.csv and *.svg      (ONLY=sh|vol|trace|dvr QUICK=1)
# make clean
# CC, CXX and CFLAGS may be set; nothing but a C compiler and make is needed.

CC      ?= cc
CXX     ?= c++
CFLAGS  ?= -O2 -g
WARN    := -Wall -Wextra -Wpedantic -Wconversion -Wsign-conversion -Wshadow -Wdouble-promotion -Wstrict-prototypes
C99     := -std=gnu99 $(WARN) -ffp-contract=off -I. -Iexamples/common
LIBS    := -lm -lpthread

HEADERS  := isogi_sh.h isogi_vol.h isogi_trace.h isogi_dvr.h
COMMON   := $(wildcard examples/common/*.h)
EXAMPLES := $(patsubst examples/%.c,build/%,$(wildcard examples/*.c))
TESTS    := $(patsubst tests/%.c,build/tests/%,$(wildcard tests/test_*.c))

all: $(EXAMPLES)

build/%: examples/%.c $(HEADERS) $(COMMON)
	@mkdir -p build
	$(CC) $(C99) $(CFLAGS) -o $@ $< $(LIBS)

build/tests/%: tests/%.c tests/test.h $(HEADERS) $(COMMON)
	@mkdir -p build/tests
	$(CC) $(C99) $(CFLAGS) -Itests -o $@ $< $(LIBS)

clean:
	rm -rf build

.PHONY: all clean
.DELETE_ON_ERROR:
