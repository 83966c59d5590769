// Plots over time with one cursor, a legend that reads out its values, and linked zoom.

const panels = [];
const MARGIN = { l: 58, r: 12, t: 8, b: 30 };
const coarse = matchMedia("(pointer: coarse)").matches;
const DASHES = { solid: "", dash: "7 4", dot: "2 3", dashdot: "7 3 2 3" };
const PLOT_CONFIG = {
  displaylogo: false, responsive: false, doubleClick: "reset",
  modeBarButtons: [["toImage", "resetScale2d"]],
};

const sizeOf = (node) => ({ width: node.clientWidth, height: node.clientHeight });

function axisStyle() {
  return {
    color: css("--soft"), gridcolor: css("--line"), zerolinecolor: css("--line"), linecolor: css("--line"),
    tickfont: { size: 11 }, automargin: false, exponentformat: "power",
  };
}

const plotStyle = (node) => ({
  ...sizeOf(node), margin: { ...MARGIN, autoexpand: false }, showlegend: false, hovermode: false,
  paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", font: { family: "system-ui, sans-serif", color: css("--ink") },
});

// Grey where there is no result.
function failureShapes() {
  return payload.failures.map(([x0, x1]) => ({
    type: "rect", layer: "below", x0, x1, yref: "paper", y0: 0, y1: 1, fillcolor: css("--soft"), opacity: 0.25,
    line: { color: css("--soft"), width: 1 },
  }));
}

function swatch(line) {
  const ns = "http://www.w3.org/2000/svg";
  const svg = document.createElementNS(ns, "svg");
  svg.setAttribute("width", 26);
  svg.setAttribute("height", 8);
  svg.setAttribute("aria-hidden", "true");
  const path = document.createElementNS(ns, "line");
  for (const [key, value] of Object.entries({ x1: 0, x2: 26, y1: 4, y2: 4, "stroke-width": 2.5 })) path.setAttribute(key, value);
  path.setAttribute("stroke-dasharray", DASHES[line.dash]);
  path.setAttribute("stroke", colour(line.colour));
  svg.append(path);
  return svg;
}

class Panel {
  constructor(spec) {
    this.spec = spec;
    this.set = 0;
    this.limits = spec.limitsInView;
    this.hidden = new Set();
    this.plot = element("div", { class: "plot", role: "img", "aria-label": `${spec.title} over time, ${spec.sets[0].lines.map((l) => l.label).join(", ")}` });
    this.graph = element("div", { style: "height:100%" });
    this.cursor = element("div", { class: "cursor", "aria-hidden": "true" });
    this.legend = element("div", { class: "legend", role: "group", "aria-label": `Lines of ${spec.title}` });
    this.plot.append(this.graph, this.cursor);
    const unit = spec.unit ? ` [${spec.unit}]` : "";
    const head = element("div", { class: "card-head" }, element("h3", {}, ...mathematics(spec.title), element("span", {}, unit)));
    if (spec.sets.length > 1) head.append(this.chooser());
    if (spec.limits.length && spec.limitsDrawn) head.append(this.limitButton());
    this.card = element("article", { class: "card", id: `panel-${spec.id}` }, head, this.plot, this.legend);
    if (spec.note) this.card.append(element("p", { class: "note" }, ...mathematics(spec.note)));
    this.listen();
  }

  get lines() { return this.spec.sets[this.set].lines; }

  chooser() {
    const select = element("select", { "aria-label": `${this.spec.title}: of` });
    this.spec.sets.forEach((set, n) => select.append(element("option", { value: n }, set.label)));
    select.addEventListener("change", () => { this.set = Number(select.value); this.hidden.clear(); this.draw(); });
    return select;
  }

  limitButton() {
    const button = element("button", { type: "button", class: "fit", "aria-pressed": this.limits }, "Limits in view");
    button.addEventListener("click", () => {
      this.limits = !this.limits;
      button.setAttribute("aria-pressed", this.limits);
      this.draw();
    });
    return button;
  }

  listen() {
    const seekTo = (event) => {
      const axis = this.graph._fullLayout?.xaxis;
      if (!axis) return;
      const x = event.clientX - this.graph.getBoundingClientRect().left - axis._offset;
      if (x >= 0 && x <= axis._length) seek(sampleAt(axis.p2d(x)));
    };
    this.plot.addEventListener("pointermove", (event) => {
      if (!clock.playing && event.pointerType === "mouse" && !event.buttons) seekTo(event);
    });
    this.plot.addEventListener("click", seekTo);
  }

  traces() {
    return this.lines.map((line, n) => ({
      ...curve(line.column, line.scale), name: plain(line.label), type: "scatter", mode: "lines",
      visible: !this.hidden.has(n), hoverinfo: "skip",
      // Without simplifying: that moves where a curve begins to rise, and bends peaks.
      line: { color: colour(line.colour), dash: line.dash, width: 1.8, simplify: false },
    }));
  }

  layout() {
    const style = axisStyle();
    const y = { ...style, zeroline: true, fixedrange: true };
    const range = this.limits ? this.spec.rangeWithLimits : null;
    // One label a limit; a level of 0 is the axis.
    const levels = !this.spec.limitsDrawn ? [] : this.spec.limits.flatMap(({ low, high, label }) => [[high, label], [low, high ? "" : label]]).filter(([value]) => value);
    return {
      ...plotStyle(this.plot), dragmode: coarse ? false : "zoom",
      modebar: { bgcolor: "rgba(0,0,0,0)", color: css("--soft"), activecolor: css("--accent") },
      xaxis: { ...style, range: this.zoom ?? [time[0], time[samples - 1]], ticksuffix: " s", zeroline: false },
      yaxis: range ? { ...y, range } : { ...y, autorange: true },
      shapes: [...failureShapes(), ...levels.map(([value]) => ({
        type: "line", xref: "paper", x0: 0, x1: 1, y0: value, y1: value, line: { color: css("--cursor"), width: 1.5, dash: "longdash" },
      }))],
      annotations: !range ? [] : levels.filter(([, label]) => label).map(([value, label]) => ({
        text: plain(label), xref: "paper", x: 1, xanchor: "right", y: value, yanchor: "top", showarrow: false,
        font: { size: 11, color: css("--cursor") },
      })),
    };
  }

  async draw() {
    this.fillLegend();
    await Plotly.react(this.graph, this.traces(), this.layout(), PLOT_CONFIG);
    if (!this.linked) {
      this.linked = true;
      this.graph.on("plotly_relayout", (event) => this.zoomed(event));
    }
    this.move(clock.index);
  }

  fillLegend() {
    this.legend.replaceChildren();
    this.valueNodes = this.lines.map((line, n) => {
      const value = element("span", { class: "value" });
      const button = element("button", { type: "button", "aria-pressed": !this.hidden.has(n), title: `Show or hide ${line.label}` },
        swatch(line), element("span", { class: "name" }, line.label), value);
      button.addEventListener("click", () => {
        if (!this.hidden.delete(n)) this.hidden.add(n);
        button.setAttribute("aria-pressed", !this.hidden.has(n));
        Plotly.restyle(this.graph, { visible: !this.hidden.has(n) }, [n]);
      });
      this.legend.append(button);
      return value;
    });
  }

  // A zoom over time in one plot is a zoom in all.
  zoomed(event) {
    const axis = this.graph._fullLayout.xaxis;
    const range = axis.range.map(Number);
    const whole = event["xaxis.autorange"] || (range[0] <= time[0] && range[1] >= time[samples - 1]);
    const next = whole ? null : range;
    for (const other of panels.filter((panel) => panel instanceof Panel)) {
      if (String(other.zoom ?? "") === String(next ?? "") && other !== this) continue;
      other.zoom = next;
      if (other !== this && other.linked) Plotly.relayout(other.graph, { "xaxis.range": next ?? [time[0], time[samples - 1]] });
    }
    this.move(clock.index);
  }

  move(index) {
    this.valueNodes?.forEach((node, n) => {
      const line = this.lines[n];
      node.textContent = shown(column(line.column)[index] * line.scale, this.spec.decimals);
    });
    const axis = this.graph._fullLayout?.xaxis;
    if (!axis) return;
    const x = axis.d2p(time[index]);
    this.cursor.hidden = x < -0.5 || x > axis._length + 0.5;
    this.cursor.style.left = `${axis._offset + x}px`;
    this.cursor.dataset.time = time[index];
  }
}
