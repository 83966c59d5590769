// Put the page together.

const frame = () => new Promise((done) => requestAnimationFrame(done));

async function start() {
  for (const spec of payload.panels) {
    const panel = new (spec.kind === "field" ? Field : Panel)(spec);
    panels.push(panel);
    document.querySelector(`#${spec.section} .grid`).append(panel.card);
  }
  for (const spec of payload.tracks) {
    const track = new Track(spec);
    tracks.push(track);
    document.querySelector("#tracks .grid").append(track.card);
  }
  for (const spec of payload.planes) {
    const plane = new Plane(spec);
    planes.push(plane);
    document.querySelector("#actuators .planes").append(plane.card);
  }
  setUpControls();
  setUpSections();
  fillReadout();
  document.getElementById("stage-note").textContent = stageNote();
  clockListeners.push(moveControls, moveStage, moveReadout);
  clockListeners.push((index) => { for (const part of [...panels, ...planes, ...tracks]) part.move(index); });
  applyTheme();
  announce();
  await drawStage();
  for (const part of [...panels, ...planes, ...tracks]) {
    await part.draw();
    await frame();  // the page answers while it is still drawing
  }
  themeListeners.push(() => { drawStage(); for (const part of [...panels, ...planes, ...tracks]) part.draw(); });
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
