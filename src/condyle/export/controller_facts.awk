# FACTS.md from what a compiler says: call graphs with stack (.ci), `size` and `objdump` of the objects.

FNR == 1 { split(FILENAME, parts, "-"); object = parts[2] }

# node: { title: "a.c:f" label: "f\na.c:1:2\n48 bytes (static)" }
/^node:/ {
    split($0, quoted, "\"")
    if (match(quoted[4], /[0-9]+ bytes/)) frame[quoted[2]] = substr(quoted[4], RSTART) + 0
    if (quoted[4] ~ /\(dynamic\)/) unbounded = 1
}

/^edge:/ {
    split($0, quoted, "\"")
    from = quoted[2]
    calls[from, ++count[from]] = quoted[4]
}

FILENAME ~ /size-/ && FNR == 2 { code[object] = $1; data[object] = $2; zeroed[object] = $3 }

FILENAME ~ /code-/ && /^ *[0-9a-f]+:\t/ { instructions[object]++ }

# The deepest stack of a function and what it calls; no function of the package calls itself.
function deepest(name,    i, most, one) {
    if (name in known) return known[name]
    most = 0
    for (i = 1; i <= count[name]; i++) {
        one = deepest(calls[name, i])
        if (one > most) most = one
    }
    return known[name] = frame[name] + most
}

function row(what, number) { printf "| %s | %d |\n", what, number }

END {
    printf "# %s: measured facts\n\nMeasured with %s.\n\n| | |\n|---|---|\n", prefix, compiler
    row("code and constants [bytes]", code["tick"] + code["controller"])
    row("of these, the tick, `" prefix ".c` [bytes]", code["tick"])
    row("instructions in the code of the tick", instructions["tick"])
    row("operations of a tick", operations)
    if (unbounded) print "| stack [bytes] | not bounded |"
    else {
        row("stack of `" prefix "_step` [bytes]", deepest(prefix "_step"))
        row("stack of `" prefix "_begin` [bytes]", deepest(prefix "_begin"))
    }
    row("memory of a `" prefix "_controller` [bytes]", zeroed["memory"])
    row("memory of a row of its log, `" prefix "_record` [bytes]", zeroed["row"])
    row("static variables [bytes]",
        data["tick"] + zeroed["tick"] + data["controller"] + zeroed["controller"])
    print "\n- Code and stack: without the C library."
    print "- Instructions: as they stand in the code; those in loops run more than once."
    print "- Operations: additions, products, roots and quotients of one tick, a fused multiply-add, or"
    print "  a sine with its cosine, counted as one."
}
