# make        the example;  make check   compares with the recorded samples
# make VECTOR=1 ..           with GCC's vector types where there are some, for this processor
CC ?= cc
CFLAGS ?= -O2
STRICT = -std=c99 -pedantic -Wall -Wextra -Wconversion -ffp-contract=fast -fno-math-errno
VECTOR_FLAGS = @vector@
FLAGS = $(STRICT) $(CFLAGS) $(if $(VECTOR),$(VECTOR_FLAGS))

all: example

example: main.c @prefix@.c @prefix@.h
	$(CC) $(FLAGS) -o $@ main.c @prefix@.c $(LDFLAGS) -lm

checker: check.c @prefix@.c @prefix@.h @prefix@_vectors.h
	$(CC) $(FLAGS) -o $@ check.c @prefix@.c $(LDFLAGS) -lm

check: checker
	$(RUN) ./checker

clean:
	rm -f example checker

.PHONY: all check clean
