// Tracks of the contact balls on their surfaces, with the bounds.

const tracks = [];

class Track {
  constructor(spec) {
    this.spec = spec;
    const words = { above: "from above", side: "from the side" }[spec.view];
    this.graph = element("div", { style: "height:100%" });
    this.dot = element("div", { class: "dot", "aria-hidden": "true" });
    this.plot = element("div", { class: "plot", role: "img", "aria-label": `Track of ${spec.contact} ${words}` }, this.graph, this.dot);
    this.value = element("p", { class: "note" });
    this.card = element("article", { class: "card track", id: `panel-${spec.id}` },
      element("div", { class: "card-head" }, element("h3", {}, `${spec.contact}, ${words}`, element("span", {}, " [mm]"))),
      this.plot, this.value);
  }

  layout() {
    const [x, y] = this.spec.bounds;
    const edge = { line: { color: css("--cursor"), width: 1.5, dash: "longdash" } };
    const across = { xref: "paper", x0: 0, x1: 1 }, along = { yref: "paper", y0: 0, y1: 1 };
    const shapes = [];
    if (x && y) shapes.push({ type: "rect", x0: x[0], x1: x[1], y0: y[0], y1: y[1], ...edge });
    else if (x) shapes.push(...x.map((v) => ({ type: "line", x0: v, x1: v, ...along, ...edge })));
    else if (y) shapes.push(...y.map((v) => ({ type: "line", y0: v, y1: v, ...across, ...edge })));
    const look = axisLook();
    return {
      ...sizeOf(this.plot), margin: { ...MARGIN, b: 38, autoexpand: false }, showlegend: false, hovermode: false, dragmode: false,
      paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", shapes,
      font: { family: "system-ui, sans-serif", color: css("--ink") },
      xaxis: { ...look, ...this.range(0), zeroline: false, title: { text: this.spec.axes[0], standoff: 4, font: { size: 12 } } },
      yaxis: { ...look, ...this.range(1), zeroline: false, scaleanchor: "x", title: { text: this.spec.axes[1], standoff: 4, font: { size: 12 } } },
    };
  }

  // Track, bounds and profile with a margin.
  range(n) {
    let low = Infinity, high = -Infinity;
    const see = (v) => { if (v !== null && Number.isFinite(v)) { low = Math.min(low, v); high = Math.max(high, v); } };
    for (const v of column(this.spec.columns[n])) see(v * this.spec.scale);
    (this.spec.bounds[n] ?? []).forEach(see);
    this.spec.profile?.[n].forEach(see);
    if (!(high >= low)) return {};
    const spare = 0.07 * (high - low) || 1;
    return { range: [low - spare, high + spare] };
  }

  async draw() {
    const [x, y] = this.spec.columns.map((c) => scaled(c, this.spec.scale));
    const traces = [{ x, y, type: "scatter", mode: "lines", hoverinfo: "skip", line: { color: colour(0), width: 2 } }];
    const profile = this.spec.profile;
    if (profile) traces.unshift({ x: profile[0], y: profile[1], type: "scatter", mode: "lines", hoverinfo: "skip", line: { color: css("--soft"), width: 1.2 } });
    await Plotly.react(this.graph, traces, this.layout(), { displayModeBar: false, responsive: false });
    this.move(clock.index);
  }

  move(index) {
    const at = this.spec.columns.map((c) => column(c)[index] * this.spec.scale);
    this.value.textContent = this.spec.axes.map((name, n) => `${name} ${shown(at[n], 3)}`).join(", ") + " mm";
    const layout = this.graph._fullLayout;
    if (!layout) return;
    const { xaxis, yaxis } = layout;
    this.dot.hidden = !at.every(Number.isFinite);
    this.dot.style.left = `${xaxis._offset + xaxis.d2p(at[0])}px`;
    this.dot.style.top = `${yaxis._offset + yaxis.d2p(at[1])}px`;
  }
}
