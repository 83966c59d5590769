// Light and dark: the system's choice until the reader makes one.

const darkSystem = matchMedia("(prefers-color-scheme: dark)");
const themeListeners = [];
let chosenTheme = null;
let printing = false;

const themeName = () =>
  printing ? "light" : chosenTheme ?? (darkSystem.matches ? "dark" : "light");

// Colours are properties of the page's style, which has both grounds.
const properties = getComputedStyle(document.documentElement);
const css = (name) => properties.getPropertyValue(name).trim();
const colour = (number) => css(`--colour-${number}`);
const role = (name) => css(`--role-${name}`);

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
