// What a reader of a page would stumble over: a list of sentences, empty if there is nothing.
() => {
  const found = new Set();
  const say = (what, element) => {
    const text = (element.textContent || element.outerHTML).trim().replace(/\s+/g, " ");
    found.add(`${what}: <${element.tagName.toLowerCase()} class="${element.className.baseVal ?? element.className}"> ${text.slice(0, 50)}`);
  };
  const seen = (element) => element.checkVisibility({ visibilityProperty: true, opacityProperty: true });

  if (!document.documentElement.lang) found.add("no language");
  if (!document.title.trim()) found.add("no title");
  if (!/width=device-width/.test(document.querySelector("meta[name=viewport]")?.content)) found.add("no viewport");
  for (const image of document.images) if (!image.alt.trim()) say("no alt text", image);
  let level = 0;
  const headings = [...document.querySelectorAll(".md-content :is(h1, h2, h3, h4, h5, h6)")];
  if (headings.filter((one) => one.tagName === "H1").length !== 1) found.add("not one first heading");
  for (const heading of headings) {
    const next = Number(heading.tagName[1]);
    if (next > level + 1) say(`heading jumps from ${level}`, heading);
    level = next;
  }
  for (const link of document.querySelectorAll(".md-content a[href]")) {
    const words = (link.innerText + (link.getAttribute("aria-label") ?? "") + link.title
      + [...link.querySelectorAll("img")].map((image) => image.alt).join("")).trim();
    if (seen(link) && (!words || /^(here|this|link|click here)$/i.test(words))) say("link without words", link);
  }

  // Contrast after WCAG 2: text on the nearest ground, translucent layers mixed.
  const brush = document.createElement("canvas").getContext("2d", { willReadFrequently: true });
  const parsed = new Map();
  const colour = (text) => {
    if (!parsed.has(text)) {
      brush.clearRect(0, 0, 1, 1);
      brush.fillStyle = text;
      brush.fillRect(0, 0, 1, 1);
      const [r, g, b, a] = brush.getImageData(0, 0, 1, 1).data;
      parsed.set(text, [r, g, b, a / 255]);
    }
    return parsed.get(text);
  };
  const over = (top, below) => top.slice(0, 3).map((part, i) => part * top[3] + below[i] * (1 - top[3]));
  const light = (rgb) => {
    const [r, g, b] = rgb.map((part) => ((part /= 255) <= 0.04045 ? part / 12.92 : ((part + 0.055) / 1.055) ** 2.4));
    return 0.2126 * r + 0.7152 * g + 0.0722 * b;
  };
  const grounds = new Map();
  const ground = (element) => {
    if (!element) return [255, 255, 255];
    if (!grounds.has(element)) grounds.set(element, over(colour(getComputedStyle(element).backgroundColor), ground(element.parentElement)));
    return grounds.get(element);
  };
  const walker = document.createTreeWalker(document.querySelector(".md-container"), NodeFilter.SHOW_TEXT);
  const done = new Set();
  while (walker.nextNode()) {
    const element = walker.currentNode.parentElement;
    if (!walker.currentNode.data.trim() || done.has(element)) continue;
    done.add(element);
    if (!seen(element) || element.closest("svg, script, style, .headerlink")) continue;
    const style = getComputedStyle(element), below = ground(element);
    const pair = [light(over(colour(style.color), below)), light(below)].sort((a, b) => b - a);
    const ratio = (pair[0] + 0.05) / (pair[1] + 0.05);
    if (ratio < 4.5) say(`contrast ${ratio.toFixed(1)}`, element);
  }
  return [...found];
}
