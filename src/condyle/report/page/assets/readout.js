// Values at the cursor in the tables of chains and contacts.

const number = (text, otherwise) => (text === undefined ? otherwise : Number(text));
const readoutCells = [...document.querySelectorAll("#readout .value")].map((node) => ({
  node, bar: node.nextElementSibling, column: Number(node.dataset.column), scale: Number(node.dataset.scale), decimals: Number(node.dataset.decimals),
}));

function moveReadout(index) {
  for (const { node, bar, column: at, scale, decimals } of readoutCells) {
    const value = column(at)[index] * scale;
    node.textContent = shown(value, decimals);
    if (!bar) continue;
    const low = number(bar.dataset.low, -Infinity), high = number(bar.dataset.high, Infinity);
    const over = value < low || value > high, bound = value < 0 ? low : high;
    bar.firstChild.style.width = over ? "100%" : `${value ? Math.min(100, 100 * Math.abs(value / bound)) : 0}%`;
    bar.classList.toggle("over", over);
  }
}
