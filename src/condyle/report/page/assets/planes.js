// Effort against speed of every actuator, with the limits that are near and where it is now.

const planes = [];

class Plane {
  constructor(spec) {
    this.spec = spec;
    this.graph = element("div", { style: "height:100%" });
    this.dots = spec.lines.map(() => element("div", { class: "dot", "aria-hidden": "true" }));
    const names = spec.lines.map((l) => l.label).join(", ");
    this.plot = element("div", { class: "plot", role: "img", "aria-label": `Effort against speed of ${spec.title}: ${names}` }, this.graph, ...this.dots);
    const unit = element("span", {}, ` [${spec.units[1]}]`);
    this.card = element("article", { class: "card plane", id: `panel-${spec.id}` },
      element("div", { class: "card-head" }, element("h3", {}, spec.title, unit)), this.plot);
    this.keys = element("div", { class: "duties" });
    this.card.append(this.keys, element("p", { class: "note" }, `Limits: ${spec.limits}`));
  }

  fillKeys() {
    this.keys.replaceChildren(...this.spec.lines.map((line) => element("p", {}, swatch(line), ` ${line.label}: ${line.text}`)));
  }

  layout() {
    const look = axisLook();
    return {
      ...sizeOf(this.plot), margin: { ...MARGIN, b: 38, autoexpand: false }, showlegend: false, hovermode: false, dragmode: false,
      paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", font: { family: "system-ui, sans-serif", color: css("--ink") },
      xaxis: { ...look, nticks: 5, zeroline: true, title: { text: `speed [${this.spec.units[0]}]`, standoff: 4, font: { size: 12 } } },
      yaxis: { ...look, nticks: 6, zeroline: true },
    };
  }

  async draw() {
    this.fillKeys();
    const traces = this.spec.lines.map((line) => {
      const [x, y] = line.columns.map((c) => column(c));
      return { x, y, type: "scatter", mode: "lines", hoverinfo: "skip", line: { color: colour(line.colour), dash: line.dash, width: 1.6 } };
    });
    for (const [x, y] of this.spec.edges) {
      traces.push({ x, y, type: "scatter", mode: "lines", hoverinfo: "skip", line: { color: css("--cursor"), dash: "longdash", width: 1.5 } });
    }
    await Plotly.react(this.graph, traces, this.layout(), { displayModeBar: false, responsive: false });
    this.move(clock.index);
  }

  move(index) {
    const layout = this.graph._fullLayout;
    if (!layout) return;
    const { xaxis, yaxis } = layout;
    this.spec.lines.forEach((line, n) => {
      const [x, y] = line.columns.map((c) => column(c)[index]);
      const dot = this.dots[n];
      dot.hidden = !Number.isFinite(x) || !Number.isFinite(y);
      dot.style.left = `${xaxis._offset + xaxis.d2p(x)}px`;
      dot.style.top = `${yaxis._offset + yaxis.d2p(y)}px`;
      dot.style.background = colour(line.colour);
    });
  }
}
