// On paper: light colours, plots as wide as the page, and a still of the 3D view.

const PAGE_WIDTH = 700;  // CSS pixels of an A4 page within its margins

function resizePlots() {
  for (const part of panels) {
    if (part.graph._fullLayout) Plotly.relayout(part.graph, sizeOf(part.plot));
    part.move(clock.index);
  }
  resizeStage();
}

// The drawing buffer of WebGL is empty when printing; a picture is not.
function still() {
  const when = `t = ${time[clock.index].toFixed(timeDecimals)} s`;
  const picture = element("img", { id: "still", alt: `The mechanism at ${when}` });
  picture.src = stageNode._fullLayout.scene._scene.toImage("png");
  return element("figure", { id: "still-figure" }, picture, element("figcaption", {}, `At ${when}`));
}

// Everything here must be done when the handler returns, so nothing is awaited.
function beforePrint() {
  if (printing) return;
  setPlaying(false);
  printing = true;
  document.body.style.width = `${PAGE_WIDTH}px`;
  document.body.classList.add("printing");
  applyTheme();
  resizePlots();
  stageNode.after(still());
  stageNode.hidden = true;
}

function afterPrint() {
  if (!printing) return;
  printing = false;
  document.body.style.width = "";
  document.body.classList.remove("printing");
  document.getElementById("still-figure")?.remove();
  stageNode.hidden = false;
  applyTheme();
  resizePlots();
}

function setUpPrinting() {
  window.addEventListener("beforeprint", beforePrint);
  window.addEventListener("afterprint", afterPrint);
}
