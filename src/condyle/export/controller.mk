# make          the objects, for this machine
# make facts    FACTS.md: code, stack and memory, as a GCC for the target makes them; no program is run
#     make facts CC=arm-none-eabi-gcc CFLAGS="-O2 -mcpu=cortex-m7 -mfpu=fpv5-d16 -mfloat-abi=hard"
ifeq ($(origin CC),default)
CC = gcc
endif
CFLAGS ?= -O2
# size and objdump of the same tools
TOOL = $(if $(filter %gcc,$(CC)),$(patsubst %gcc,%,$(CC)))
FLAGS = -std=c99 -pedantic -Wall -Wextra -ffp-contract=fast -fno-math-errno $(CFLAGS)
HEADERS = @prefix@.h @prefix@_controller.h

all: @prefix@.o @prefix@_controller.o

%.o: %.c $(HEADERS)
	$(CC) $(FLAGS) -c -o $@ $<

# In a folder of its own, made anew: for other flags, or another target.
facts:
	rm -rf facts
	mkdir facts
	$(CC) $(FLAGS) -fcallgraph-info=su -c -o facts/tick.o @prefix@.c
	$(CC) $(FLAGS) -fcallgraph-info=su -c -o facts/controller.o @prefix@_controller.c
	printf '#include "@prefix@_controller.h"\nchar room[sizeof(@prefix@_controller)];\n' > facts/memory.c
	printf '#include "@prefix@_controller.h"\nchar room[sizeof(@prefix@_record)];\n' > facts/row.c
	$(CC) $(FLAGS) -fno-common -I. -c -o facts/memory.o facts/memory.c
	$(CC) $(FLAGS) -fno-common -I. -c -o facts/row.o facts/row.c
	for object in tick controller memory row; do \
	    $(TOOL)size facts/$$object.o > facts/size-$$object || exit 1; \
	    $(TOOL)objdump -d facts/$$object.o > facts/code-$$object || exit 1; \
	done
	$(CC) --version > facts/version
	awk -v compiler="$$(head -n 1 facts/version), $(CFLAGS)" -v prefix=@prefix@ -v operations=@operations@ \
	    -f facts.awk facts/*.ci facts/size-* facts/code-* > facts/FACTS.md
	mv facts/FACTS.md FACTS.md
	rm -rf facts

clean:
	rm -rf facts @prefix@.o @prefix@_controller.o

.PHONY: all facts clean
