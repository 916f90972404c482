// ---- What all pages use ----

const $ = (id) => document.getElementById(id);
const element = (tag, properties = {}, ...children) => {
  const made = Object.assign(document.createElement(tag), properties);
  made.append(...children);
  return made;
};

/** A colour of the style sheet in the present scheme, light or dark; an invisible element is asked for it. */
function colour(name) {
  const probe = $("said");
  probe.style.color = `var(--${name})`;
  return getComputedStyle(probe).color;
}

let colours = {};
function readColours() {
  const names = ["ink", "soft", "line", "floor", "wall", "obstacle", "lamp", "near", "rose", "fell", "won", "left", "right", "side", "card"];
  colours = Object.fromEntries(names.map((name) => [name, colour(name)]));
}

/** Fit a canvas to its place on the page and clear it; returns its context, in pixels of the page. */
function fit(canvas, height) {
  const width = canvas.clientWidth, ratio = Math.min(2, devicePixelRatio);
  canvas.style.height = `${height(width)}px`;
  [canvas.width, canvas.height] = [Math.round(width * ratio), Math.round(height(width) * ratio)];
  const pen = canvas.getContext("2d");
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.font = "11px system-ui, sans-serif";
  return pen;
}

const dark = matchMedia("(prefers-color-scheme: dark)");
/** Dark colours in place of light ones, or light ones in place of dark ones. */
function changeScheme() {
  const root = document.documentElement.style, isDark = root.colorScheme ? root.colorScheme === "dark" : dark.matches;
  root.colorScheme = isDark ? "light" : "dark";
}
