// Curves over something else than time, with a dot where they are now: efforts against speeds in the
// box of their limits, and tracks of contact balls against their bounds, on equal scales.

class Plane {
  constructor(spec) {
    this.spec = spec;
    this.lines = spec.sets[0].lines;
    this.track = spec.kind === "track";
    this.axes = this.track ? spec.axes.map((name) => `${name} [${spec.unit}]`) : [spec.axes[0], ""];
    this.graph = element("div", { style: "height:100%" });
    this.dots = this.lines.map(() => element("div", { class: "dot", "aria-hidden": "true" }));
    const names = this.lines.map((line) => line.label).join(", ");
    const what = this.track ? `Track of ${spec.title}` : `Effort against speed of ${spec.title}: ${names}`;
    this.plot = element("div", { class: "plot", role: "img", "aria-label": what }, this.graph, ...this.dots);
    this.keys = element(this.track ? "p" : "div", { class: this.track ? "note" : "duties" });
    this.card = element("article", { class: `card ${spec.kind}`, id: `panel-${spec.id}` },
      element("div", { class: "card-head" }, element("h3", {}, spec.title, element("span", {}, ` [${spec.unit}]`))), this.plot, this.keys);
    if (!this.track) this.card.append(element("p", { class: "note" }, `Limits: ${spec.note}`));
  }

  // Numbers of a line's columns, across and up, with their scales.
  numbers(line) { return [[line.across, this.track ? line.scale : 1], [line.column, line.scale]]; }

  layout() {
    const style = axisStyle(), title = (text) => ({ text, standoff: 4, font: { size: 12 } });
    const found = { ...plotStyle(this.plot), margin: { ...MARGIN, b: 38, autoexpand: false }, dragmode: false };
    found.xaxis = { ...style, nticks: 5, zeroline: true, title: title(this.axes[0]) };
    found.yaxis = { ...style, nticks: 6, zeroline: true };
    if (this.track) {
      const [across, up] = this.spec.ranges.map((range) => (range ? { range } : {}));
      Object.assign(found.xaxis, across, { nticks: 0, zeroline: false });
      Object.assign(found.yaxis, up, { nticks: 0, zeroline: false, scaleanchor: "x", title: title(this.axes[1]) });
      found.shapes = this.spec.shapes.map((shape) => ({ ...shape, line: { color: css("--cursor"), width: 1.5, dash: "longdash" } }));
    }
    return found;
  }

  async draw() {
    const trace = ([x, y], line) => ({ x, y, type: "scatter", mode: "lines", hoverinfo: "skip", line });
    const limit = this.track ? { color: css("--soft"), width: 1.2 } : { color: css("--cursor"), dash: "longdash", width: 1.5 };
    const traces = this.lines.map((line) => trace(this.numbers(line).map(([n, scale]) => scaled(n, scale)),
      { color: colour(line.colour), dash: line.dash, width: this.track ? 2 : 1.6 }));
    const fixed = this.spec.fixed.map((pair) => trace(pair, limit));
    if (!this.track) this.keys.replaceChildren(...this.lines.map((line) => element("p", {}, swatch(line), ` ${line.label}: ${line.text}`)));
    await Plotly.react(this.graph, this.track ? [...fixed, ...traces] : [...traces, ...fixed], this.layout(), { displayModeBar: false, responsive: false });
    this.move(clock.index);
  }

  move(index) {
    const axes = this.graph._fullLayout;
    this.lines.forEach((line, n) => {
      const at = this.numbers(line).map(([number, scale]) => column(number)[index] * scale);
      if (this.track) this.keys.textContent = `${this.spec.axes.map((name, k) => `${name} ${shown(at[k], 3)}`).join(", ")} ${this.spec.unit}`;
      const dot = this.dots[n];
      dot.hidden = !axes || !at.every(Number.isFinite);
      if (dot.hidden) return;
      dot.style.left = `${axes.xaxis._offset + axes.xaxis.d2p(at[0])}px`;
      dot.style.top = `${axes.yaxis._offset + axes.yaxis.d2p(at[1])}px`;
      if (!this.track) dot.style.background = colour(line.colour);
    });
  }
}
