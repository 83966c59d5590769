// Light and dark: the system's choice until the reader makes one.

const darkSystem = matchMedia("(prefers-color-scheme: dark)");
const themeListeners = [];
let chosenTheme = null;
let printing = false;

const themeName = () =>
  printing ? "light" : chosenTheme ?? (darkSystem.matches ? "dark" : "light");

const colour = (number) => payload.machine.palette[themeName()][number];
const role = (name) => payload.machine.roles[name][themeName() === "dark" ? 1 : 0];
const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

function applyTheme() {
  const name = themeName();
  document.documentElement.dataset.theme = name;
  document.getElementById("theme").textContent = name === "dark" ? "Light" : "Dark";
  for (const listener of themeListeners) listener();
}

function toggleTheme() {
  chosenTheme = themeName() === "dark" ? "light" : "dark";
  applyTheme();
}

darkSystem.addEventListener("change", applyTheme);
document.documentElement.dataset.theme = themeName();
