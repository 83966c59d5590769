// Activations: a row of colour for each actuator, time across, under the same cursor.

const ROW = 15;  // pixels
const FIELD_COLOURS = [[0, "#ffffd9"], [0.25, "#c7e9b4"], [0.5, "#41b6c4"], [0.75, "#225ea8"], [1, "#081d58"]];
const BEYOND = "#D55E00";

class Field extends Panel {
  constructor(spec) {
    super(spec);
    this.card.classList.add("field");
    this.plot.style.height = `${MARGIN.t + MARGIN.b + ROW * Math.max(this.lines.length, 6)}px`;
  }

  // Colours go from 0 to `top`, 1 or less, and one more stands for everything beyond 1.
  traces() {
    const top = this.spec.top, most = 1.0001 * top;
    return [{
      type: "heatmap", x: time, y: this.lines.map((line) => plain(line.label)), hoverinfo: "skip",
      z: this.lines.map((line) => Array.from(column(line.column), (v) => (Number.isFinite(v) ? Math.min(Math.abs(v) * line.scale, most) : null))),
      zmin: 0, zmax: most, colorscale: [...FIELD_COLOURS.map(([at, c]) => [at / 1.0001, c]), [1, top < 1 ? FIELD_COLOURS.at(-1)[1] : BEYOND]],
      colorbar: { thickness: 10, outlinewidth: 0, tickfont: { size: 10, color: css("--soft") }, tickvals: [0, top / 2, top], xpad: 4 },
    }];
  }

  layout() {
    const found = super.layout();
    const longest = Math.max(...this.lines.map((line) => line.label.length));
    return {
      ...found, margin: { ...found.margin, l: Math.min(12 + 6.2 * longest, 0.45 * found.width), r: 48 },
      yaxis: { ...axisStyle(), fixedrange: true, autorange: "reversed", dtick: 1, tickfont: { size: 10 }, showgrid: false },
      shapes: failureShapes(), annotations: [],
    };
  }

  // Rows cannot be hidden: the names are beside them, and here stand the values alone.
  fillLegend() {
    this.legend.replaceChildren();
    this.valueNodes = this.lines.map((line) => {
      const value = element("span", { class: "value" });
      this.legend.append(element("div", {}, element("span", { class: "name" }, line.label), value));
      return value;
    });
  }

  move(index) {
    super.move(index);
    this.valueNodes?.forEach((node, n) => {
      const line = this.lines[n];
      node.textContent = shown(Math.abs(column(line.column)[index]) * line.scale, this.spec.decimals);
    });
  }
}
