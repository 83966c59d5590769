// Put the page together.

const KINDS = { time: Panel, field: Field, plane: Plane, track: Plane };
const frame = () => new Promise((done) => requestAnimationFrame(done));

async function start() {
  for (const spec of payload.panels) {
    const panel = new KINDS[spec.kind](spec);
    panels.push(panel);
    document.querySelector(`#${spec.section} .${spec.kind === "plane" ? "planes" : "grid"}`).append(panel.card);
  }
  setUpControls();
  setUpSections();
  clockListeners.push(moveControls, moveStage, moveReadout);
  clockListeners.push((index) => { for (const part of panels) part.move(index); });
  applyTheme();
  announce();
  await drawStage();
  for (const part of panels) {
    await part.draw();
    await frame();  // the page answers while it is still drawing
  }
  themeListeners.push(() => { drawStage(); for (const part of panels) part.draw(); });
  window.addEventListener("resize", later(resizePlots, 120));
  setUpPrinting();
  document.documentElement.dataset.ready = "true";
}

function later(action, wait) {
  let timer = 0;
  return () => {
    clearTimeout(timer);
    timer = setTimeout(action, wait);
  };
}

start();
