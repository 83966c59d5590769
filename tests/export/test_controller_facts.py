"""`make facts` of an exported controller, against the tools and a stack that is looked at."""

from __future__ import annotations

import re
from pathlib import Path

from export.test_compilers import CORTEX
from export.test_ros2 import FOLLOW
from support.tools import need, run

import condyle

# Ticks on a stack that was painted; the thread does as much, but for the tick, the first time.
USED = """
#include <pthread.h>
#include <stdio.h>
#include <string.h>
#include "masticatory_controller.h"
enum { SIZE = 1 << 18 };
static unsigned char stack[SIZE] __attribute__((aligned(4096)));
static masticatory_controller c;
static int ticks;
static void *work(void *given)
{
    masticatory_measured m = {0};
    masticatory_reference to = {0};
    double effort[MASTICATORY_JOINTS];
    for (int k = 0; k < ticks; k++)
        masticatory_step(&c, 0.002 * k, &m, MASTICATORY_WANT_HOLD, &to, effort);
    return given;
}
static long used(int count)
{
    pthread_t thread;
    pthread_attr_t how;
    long left = 0;
    ticks = count;
    memset(stack, 0xa5, SIZE);
    pthread_attr_init(&how);
    pthread_attr_setstack(&how, stack, SIZE);
    pthread_create(&thread, &how, work, NULL);
    pthread_join(thread, NULL);
    while (stack[left] == 0xa5) left++;
    return SIZE - left;
}
int main(void)
{
    const double q[MASTICATORY_FREE] = {0};
    masticatory_begin(&c, &MASTICATORY_SETTINGS, q, q, NULL, MASTICATORY_HOLD, NULL, 0);
    const long bare = used(0);
    printf("%ld %zu %zu\\n", used(500) - bare, sizeof c, sizeof(masticatory_record));
    return 0;
}
"""


def facts(folder: Path, *words: str) -> dict[str, int]:
    """The rows of the page."""
    run("make", "-s", "facts", *words, folder=folder)
    text = (folder / "FACTS.md").read_text()
    return {key: int(x) for key, x in re.findall(r"^\| (.+?) \| (\d+) \|$", text, re.MULTILINE)}


def test_facts_are_those_of_the_target(tmp_path: Path) -> None:
    need("gcc", "make", "awk", "arm-none-eabi-gcc", "arm-none-eabi-size")
    made = condyle.export_controller("masticatory", FOLLOW, tmp_path, size="small")
    assert {"Makefile", "facts.awk"} <= {file.name for file in made}
    (tmp_path / "used.c").write_text(USED)
    sources = [f"masticatory{part}.c" for part in ("", "_controller")]
    call = ("gcc", "-std=c99", "-O2", "-ffp-contract=fast", "-fno-math-errno", "-static")
    run(*call, "used.c", *sources, "-o", "used", "-lpthread", "-lm", folder=tmp_path)
    stack, controller, record = map(int, run(tmp_path / "used", folder=tmp_path).split())
    here = facts(tmp_path, "CC=gcc")
    room = "memory of a row of its log, `masticatory_record` [bytes]"
    assert here["memory of a `masticatory_controller` [bytes]"] == controller
    assert here[room] == record and here["static variables [bytes]"] == 0
    # The C library comes to what was used; branches that were not taken do not.
    assert stack - 1500 < here["stack of `masticatory_step` [bytes]"] < stack + 1500
    there = facts(tmp_path, "CC=arm-none-eabi-gcc", f"CFLAGS=-O2 {CORTEX}")
    call = ("arm-none-eabi-gcc", "-std=c99", "-O2", *CORTEX.split(), "-ffp-contract=fast")
    sizes = []
    for source in sources:
        run(*call, "-fno-math-errno", "-c", source, "-o", "one.o", folder=tmp_path)
        sizes.append(int(run("arm-none-eabi-size", "one.o", folder=tmp_path).split()[6]))
    assert there["code and constants [bytes]"] == sum(sizes)
    assert there["of these, the tick, `masticatory.c` [bytes]"] == sizes[0]
    assert 1000 < there["instructions in the code of the tick"] < sizes[0] / 2  # 2 to 4 bytes each
    assert there["operations of a tick"] == here["operations of a tick"] > 1000
    assert there[room] == here[room]  # doubles and ints are alike
    left = {file.name for file in tmp_path.iterdir()} - {file.name for file in made}
    assert left == {"FACTS.md", "used", "used.c", "one.o"}
