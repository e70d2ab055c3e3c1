// Small helpers for making HTML and SVG elements. Text always goes in as text, never as markup.

const SVG = "http://www.w3.org/2000/svg";

function fill(element, attributes, children) {
  for (const [name, value] of Object.entries(attributes)) {
    if (value === undefined || value === null || value === false) continue;
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (name === "style" && typeof value === "object") {
      for (const [property, setting] of Object.entries(value)) element.style.setProperty(property, setting);
    } else element.setAttribute(name, value === true ? "" : String(value));
  }
  for (const child of children.flat(Infinity)) {
    if (child === undefined || child === null || child === false) continue;
    element.append(child instanceof Node ? child : document.createTextNode(String(child)));
  }
  return element;
}

/** An HTML element. `on…` attributes are listeners, a `style` object sets properties. */
export function el(tag, attributes = {}, ...children) {
  return fill(document.createElement(tag), attributes, children);
}

/** An SVG element. */
export function svg(tag, attributes = {}, ...children) {
  return fill(document.createElementNS(SVG, tag), attributes, children);
}

const numbered = new Map();

/** The next number of its kind, as in "Figure 3". Figures count in the order in which they are made. */
export function numberOf(kind) {
  numbered.set(kind, (numbered.get(kind) ?? 0) + 1);
  return `${kind} ${numbered.get(kind)}`;
}

/** A figure with its caption: its name in bold, then words. */
export function figure(name, caption, ...children) {
  return el("figure", {}, ...children, el("figcaption", {}, name && el("b", {}, `${name}. `), caption));
}

/** A key to colours: [name, colour] pairs. */
export function legend(entries, kind = "swatch") {
  return el("ul", { class: "legend" }, entries.map(([name, color]) =>
    el("li", {}, el("span", { class: kind, style: { "--ink": color }, "aria-hidden": "true" }), name)));
}

/** Whether the reader asked for less motion. */
export const calm = () => matchMedia("(prefers-reduced-motion: reduce)").matches;
