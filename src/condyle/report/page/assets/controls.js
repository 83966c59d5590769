// Buttons, the time slider and the keyboard.

const scrub = document.getElementById("scrub");
const playButton = document.getElementById("play");
const now = document.getElementById("now");
const speed = document.getElementById("speed");

function moveControls(index) {
  scrub.value = index;
  const t = time[index].toFixed(timeDecimals);
  scrub.setAttribute("aria-valuetext", `${t} seconds`);
  now.textContent = `${t} / ${time[samples - 1].toFixed(timeDecimals)} s`;
  const label = clock.playing ? "Pause" : "Play";
  if (playButton.textContent !== label) {
    playButton.textContent = label;
    playButton.setAttribute("aria-label", label);
  }
}

function changeSpeed(step) {
  speed.selectedIndex = Math.min(Math.max(speed.selectedIndex + step, 0), speed.length - 1);
  setSpeed(Number(speed.value));
}

const HUNDREDTH = Math.max(Math.round(samples / 100), 1);
const KEYS = {
  " ": () => setPlaying(!clock.playing),
  ArrowLeft: (event) => seek(clock.index - (event.shiftKey ? 1 : HUNDREDTH)),
  ArrowRight: (event) => seek(clock.index + (event.shiftKey ? 1 : HUNDREDTH)),
  Home: () => seek(0),
  End: () => seek(samples - 1),
  "+": () => changeSpeed(1),
  "=": () => changeSpeed(1),
  "-": () => changeSpeed(-1),
  t: toggleTheme,
  p: () => window.print(),
};
Object.keys(CAMERAS).forEach((name, n) => { KEYS[String(n + 1)] = () => setCamera(name); });

function onKey(event) {
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  const target = event.target;
  // A control keeps the keys it has a use for.
  if (target.tagName === "SELECT" || target.closest?.(".wide") && event.key.startsWith("Arrow")) return;
  if (event.key === " " && ["BUTTON", "SUMMARY", "A"].includes(target.tagName)) return;
  const action = KEYS[event.key.length === 1 ? event.key.toLowerCase() : event.key];
  if (!action) return;
  event.preventDefault();
  action(event);
}

function setUpControls() {
  scrub.max = samples - 1;
  scrub.addEventListener("input", () => seek(Number(scrub.value)));
  playButton.addEventListener("click", () => setPlaying(!clock.playing));
  document.getElementById("back").addEventListener("click", () => seek(clock.index - 1));
  document.getElementById("forward").addEventListener("click", () => seek(clock.index + 1));
  speed.addEventListener("change", () => setSpeed(Number(speed.value)));
  document.getElementById("theme").addEventListener("click", toggleTheme);
  document.getElementById("print").addEventListener("click", () => window.print());
  document.addEventListener("keydown", onKey);
  for (const button of document.querySelectorAll("[data-view]")) button.addEventListener("click", () => setCamera(button.dataset.view));
  for (const button of document.querySelectorAll("[data-layer]")) {
    button.addEventListener("click", () => {
      const on = button.getAttribute("aria-pressed") !== "true";
      button.setAttribute("aria-pressed", on);
      setLayer(button.dataset.layer, on);
    });
  }
}

function setUpSections() {
  const nav = document.getElementById("sections");
  for (const section of document.querySelectorAll("main section[id]")) {
    const empty = section.classList.contains("block") && !section.querySelector(".card");
    if (empty) section.remove();
    else if (section.id !== "warnings") nav.append(element("a", { href: `#${section.id}` }, section.querySelector("h2").textContent));
  }
}
