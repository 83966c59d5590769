// A table of the chains' and contacts' values at the cursor.

const readoutCells = [];

// Lines of the panel whose id starts so, by label; panels of several units add up.
function linesOf(prefix) {
  const found = new Map();
  for (const panel of payload.panels.filter((p) => p.id.startsWith(prefix))) {
    for (const line of panel.sets[0].lines) found.set(line.label, { ...line, panel });
  }
  return found;
}

function readoutTable(caption, header, prefixes) {
  const found = prefixes.map(linesOf);
  const names = [...found[0].keys()];
  if (!names.length) return [];
  const body = element("tbody");
  for (const name of names) {
    const row = element("tr", {}, element("th", { scope: "row" }, name));
    found.forEach((lines, n) => {
      const cell = element("td");
      row.append(cell);
      const line = lines.get(name);
      if (!line) return;
      const value = element("span", { class: "value" });
      cell.append(value);
      const limit = prefixes[n].startsWith("effort") ? line.panel.limits.find((l) => l.of.includes(name) && (l.low || l.high)) : null;
      const bar = limit ? element("span", { class: "use", title: limit.label }, element("i")) : null;
      if (bar) cell.append(bar);
      readoutCells.push({ value, bar, line, limit });
    });
    body.append(row);
  }
  const head = element("thead", {}, element("tr", {}, ...header.map((h) => element("th", { scope: "col" }, h))));
  return [element("table", { "aria-label": caption }, head, body)];
}

function fillReadout() {
  const units = (prefix) => [...new Set(payload.panels.filter((p) => p.id.startsWith(prefix)).map((p) => p.unit))].join(", ");
  document.getElementById("readout").append(
    ...readoutTable(say("Chains at the cursor"),
      [say("Chain"), `${say("joint")} [${units("joint-")}]`, `speed [${units("joint_rate-")}]`, `${say("effort")} [${units("effort-")}]`],
      ["joint-", "joint_rate-", "effort-"]),
    ...readoutTable(say("Contacts at the cursor"), [say("Contact"), "force [N]", "to the bounds [mm]"], ["contact-force", "bound-margin"]),
  );
}

function moveReadout(index) {
  for (const { value, bar, line, limit } of readoutCells) {
    const number = column(line.column)[index] * line.scale;
    value.textContent = shown(number, line.panel.decimals);
    if (bar) {
      const bound = (number < 0 ? limit.low : limit.high) ?? Infinity;
      const over = number < (limit.low ?? -Infinity) || number > (limit.high ?? Infinity);
      bar.firstChild.style.width = over ? "100%" : `${number ? Math.min(100, 100 * Math.abs(number / bound)) : 0}%`;
      bar.classList.toggle("over", over);
    }
  }
}
