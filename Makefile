# make           the viewer and the example programs, into build/
# make demo      volume in, globally lit pictures out: build/demo/*.png    (VOLUME=FILE ISO=V SPACING=X,Y,Z UP=X,Y,Z: your own)
# make figures   the figures of the papers, with our data, and how far they are from path tracing: build/figures/index.html
# make pictures  the pictures of README.md anew: examples/*.png
# make test      the quick tests, under two minutes; ends with "N passed, N failed, N skipped"
# make check     the long suite: full sizes, every compiler, sanitizer and emulator that is installed
# make bench     run time against error: build/bench/*.csv and *.svg      (ONLY=sh|vol|trace|dvr|visibility|threads QUICK=1)
# make bench-peers   rays beside Embree 3, on this machine, where <embree3/rtcore.h> is (libembree-dev), frames and meshes beside VTK 9
#                    where its headers are (libvtk9-dev), and harmonics beside generated code, and beside sphericart and SHTns where
#                    SPHERICART names a folder with include/ and lib/libsphericart.so, SHTNS one with shtns.h and libshtns.a
# make clean
# CC, CXX and CFLAGS may be set; nothing but a C compiler and make is needed.

CC     ?= cc
CXX    ?= c++
CFLAGS ?= -O2 -g1
WARN   := -Wall -Wextra -Wpedantic -Wconversion -Wsign-conversion -Wshadow -Wdouble-promotion -Wstrict-prototypes \
	-Wno-enum-float-conversion
C99    := -std=gnu99 $(WARN) -ffp-contract=off -I. -Iexamples/common
LIBS   := -lm -lpthread

# bake_mpi is built where there is an MPI compiler, and by that.
MPICC    := $(shell command -v mpicc 2>/dev/null)
EXAMPLES := $(patsubst examples/%.c,build/%,$(filter-out $(if $(MPICC),,examples/bake_mpi.c),$(wildcard examples/*.c)))
INSIDE   := $(patsubst tests/%.c,build/tests/%,$(shell grep -l 'isogi_[a-z]*__\|looks inside' tests/test_*.c))
TESTS    := $(filter-out $(INSIDE),$(patsubst tests/%.c,build/tests/%,$(wildcard tests/test_*.c)))
BENCHES  := $(patsubst tests/bench/%.c,build/bench/%,$(wildcard tests/bench/bench_$(or $(ONLY),*).c))

# As many jobs as processors, unless the caller chose a number.
PROCESSORS := $(shell getconf _NPROCESSORS_ONLN 2>/dev/null || echo 2)
PARALLEL    = $(if $(findstring -j,$(MAKEFLAGS)),,-j$(PROCESSORS))
QUIET_MAKE  = $(MAKE) --no-print-directory $(PARALLEL)

export CC CXX CFLAGS SPHERICART SHTNS

comma := ,

all: $(EXAMPLES)

# The implementation of each header is compiled once, and switched off in the programs that are linked with it: it takes most of the
# time. A test that looks at what is private to a header (isogi_vol__name) holds that header's implementation itself, and takes as long:
# those, INSIDE, are left to `make check`, as are the instruction levels of test_sh. Test programs are compiled at -O1, in half the time:
# what they test is in those objects, as its users compile it. The headers that take longest come first. Tests that do little themselves
# are compiled at -O0.
HEADERS := dvr:DVR vol:VOL sh:SH trace:TRACE
OBJECTS := $(foreach h,$(HEADERS),build/isogi_$(firstword $(subst :, ,$(h))).o)

# What a source file includes is found by the compiler (the .d files). A line "LIBS: -lname" in a test's first comment names
# libraries of its own, on another line "FLAGS: -O0" options. What does not compile must not leave an older program behind.
COMPILE = @rm -f $@; echo "$(CC) $<"; libs= flags= shared=; \
	eval "$$(sed -n '1,20{s|.*LIBS: \([^*]*\).*|libs="\1"|p;s|.*FLAGS: \([^*]*\).*|flags="\1"|p;}' $<)"; \
	inside=$$(grep -o 'isogi_[a-z]*__\|looks inside.*' $<); \
	for h in $(HEADERS); do \
		case $$inside in *isogi_$${h%:*}__* | *"looks inside"*isogi_$${h%:*}*) ;; \
		*) shared="$$shared -DISOGI_$${h\#*:}_IMPLEMENTED build/isogi_$${h%:*}.o" ;; esac; \
	done; \
	$(CC) $(C99) $(CFLAGS) -MMD -MP -MF $@.d -MT $@ $(1) $$flags -o $@ $< $$shared $(LIBS) $$libs

# As strict C99; what the compiler said is kept for the tests, which want silence.
$(OBJECTS): build/%.o: %.h tests/compile/one.c build/flags
	@rm -f $@; echo "$(CC) $<"; $(CC) $(C99:-std=gnu99=-std=c99) $(CFLAGS) -MMD -MP -MF $@.d -MT $@ -DHEADER='"$<"' \
		-D$$(echo $* | tr a-z A-Z)_IMPLEMENTATION -c -o $@ tests/compile/one.c 2> $@.said; status=$$?; cat $@.said >&2; exit $$status

build/%: examples/%.c build/flags $(OBJECTS)
	$(call COMPILE)

# MPI's headers do not keep to our warnings.
build/bake_mpi: examples/bake_mpi.c build/flags
	@rm -f $@; echo "mpicc $<"; mpicc -std=gnu99 -Wall -Wextra -ffp-contract=off -I. -Iexamples/common $(CFLAGS) -MMD -MP \
		-MF $@.d -MT $@ -o $@ $< $(LIBS)

build/tests/%: tests/%.c build/flags $(OBJECTS)
	$(call COMPILE,$(if $(filter -O2,$(CFLAGS)),-O1) -Itests)

build/bench/%: tests/bench/%.c build/flags $(OBJECTS)
	$(call COMPILE,-Itests)

# with the peers whose folders are named
HARMONICS := $(if $(SPHERICART),-DPEER_SPHERICART -isystem "$(SPHERICART)/include" \
	"-L$(SPHERICART)/lib" "-Wl$(comma)-rpath$(comma)$(SPHERICART)/lib") \
	$(if $(SHTNS),-DPEER_SHTNS -isystem "$(SHTNS)" "-L$(SHTNS)")
build/bench/peer_harmonics: tests/bench/peer_harmonics.c build/flags $(OBJECTS) FORCE
	$(call COMPILE,$(HARMONICS)) $(if $(SPHERICART),-lsphericart) $(if $(SHTNS),-lshtns -lfftw3)

# VTK 9, as Debian's libvtk9-dev installs it.
VTK      := $(notdir $(lastword $(sort $(wildcard /usr/include/vtk-9*))))
VTK_LIBS := RenderingVolumeOpenGL2 RenderingVolume RenderingCore FiltersCore CommonExecutionModel CommonDataModel CommonMisc CommonCore
build/bench/peer_vtk: tests/bench/peer_vtk.cpp build/flags $(OBJECTS)
	@rm -f $@; echo "$(CXX) $<"; $(CXX) -std=c++17 -Wall -Wextra $(CFLAGS) -I. -isystem /usr/include/$(VTK) -MMD -MP -MF $@.d -MT $@ -o $@ $< \
		build/isogi_sh.o build/isogi_vol.o build/isogi_dvr.o $(VTK_LIBS:%=-lvtk%-$(VTK:vtk-%=%)) $(LIBS)

# Changes only when the compiler or its flags do, so that another CC builds everything anew.
build/flags: FORCE
	@mkdir -p build/tests build/bench build/demo
	@printf '%s\n' '$(CC) $(C99) $(CFLAGS) $(LIBS)' | cmp -s - $@ || printf '%s\n' '$(CC) $(C99) $(CFLAGS) $(LIBS)' > $@

# ---- demo: what the user chose reaches the script through the environment, whatever characters it holds ----

demo: override export VOLUME := $(value VOLUME)
demo: override export ISO := $(value ISO)
demo: override export SPACING := $(value SPACING)
demo: override export UP := $(value UP)
demo:
	@$(QUIET_MAKE) build/viewer
	@sh examples/demo.sh

figures:
	@$(QUIET_MAKE) build/viewer build/isolines build/tets
	@sh examples/figures.sh
	@FIGURES_PAGE=build/figures/index.html sh examples/figures_scale_invariant.sh
	@FIGURES_PAGE=build/figures/index.html sh examples/figures_visibility.sh

pictures:
	@$(QUIET_MAKE) build/viewer build/strip
	@sh examples/pictures.sh

# ---- tests ----

programs: $(EXAMPLES) $(TESTS)
inside: programs $(INSIDE)

test:
	@$(QUIET_MAKE) -k programs || true
	@sh tests/suite.sh quick $(TESTS) | sh tests/run.sh $(PROCESSORS)

check:
	@$(QUIET_MAKE) -k inside || true
	@sh tests/suite.sh long $(TESTS) $(INSIDE) | sh tests/run.sh $(PROCESSORS)

# ---- benchmarks: one at a time, since they measure ----

bench: $(if $(BENCHES),build/bench/plot,bench-unknown)
	@$(QUIET_MAKE) $(BENCHES)
	@for b in $(patsubst build/bench/bench_%,%,$(BENCHES)); do \
		echo "$$b"; \
		build/bench/bench_$$b $(if $(QUICK),--quick) build/bench/$$b.csv && \
		build/bench/plot build/bench/$$b.csv build/bench/$$b.svg || exit 1; \
	done

bench-unknown:
	@echo "make bench: there is no benchmark ONLY=$(ONLY), but $(patsubst tests/bench/bench_%.c,%,$(wildcard tests/bench/bench_*.c))" >&2
	@false

bench-peers: build/flags
	@if echo '#include <embree3/rtcore.h>' | $(CC) -E - > build/bench/peers.log 2>&1; then \
		$(QUIET_MAKE) build/bench/peer_embree && build/bench/peer_embree; \
	else echo "bench-peers: <embree3/rtcore.h> is not there (libembree-dev): nothing to compare with"; fi
	@if [ -n "$(VTK)" ]; then $(QUIET_MAKE) build/bench/peer_vtk && build/bench/peer_vtk; \
	else echo "bench-peers: VTK 9's headers are not there (libvtk9-dev): nothing to compare with"; fi
	@$(QUIET_MAKE) build/bench/peer_harmonics && OMP_NUM_THREADS=1 build/bench/peer_harmonics

clean:
	rm -rf build

-include $(wildcard build/*.d build/tests/*.d build/bench/*.d)

FORCE:
.PHONY: all demo figures pictures programs inside test check bench bench-unknown bench-peers clean FORCE
.DELETE_ON_ERROR:
