// Elements: made in one call, and icons drawn as strokes.

/** An element with properties, attributes (keys with a dash, and role) and children. */
export function h(tag, properties = {}, ...children) {
  const element = document.createElement(tag);
  for (const [key, value] of Object.entries(properties)) {
    if (value === undefined || value === null) continue;
    if (key.includes("-") || key === "role" || key === "for") element.setAttribute(key, value);
    else element[key] = value;
  }
  element.append(...children.flat().filter((child) => child !== null && child !== undefined));
  return element;
}

/** The element with an id. */
export const byId = (id) => document.getElementById(id);

const SHAPES = {
  pan: "M8 12.500V6.300a1.400 1.400 0 0 1 2.800 0V11m0-5.800a1.400 1.400 0 0 1 2.800 0V11m0-4.700a1.400 1.400 0 0 1 2.800 0V12m0-3.200a1.400 1.400 0 0 1 2.800 0V14c0 4-2.600 6.500-6 6.500-3 0-4.400-1.300-6-4l-2-3.500c-.8-1.500.9-2.500 2-1.300l.8.800",
  brush: "M19.500 4.500c-4 1.500-8.500 5.800-10.200 9l1.700 1.700c3.200-1.700 7.500-6.200 9-10.200zM8.600 14.600c-2.400 0-3 1.500-3.200 3-.1 1-.9 1.600-1.900 1.700 1.500 1.300 6.700 1.400 6.800-2.900",
  rectangle: "M4.500 6.500h15v11h-15z",
  polygon: "M12 4l7.500 5.600-2.900 9H7.400l-2.900-9z",
  fill: "M11.500 4.500l7.200 7.200-6.300 6.300a2 2 0 0 1-2.800 0L5.200 13.600a2 2 0 0 1 0-2.800zM11.500 4.500L9.800 2.800M4.800 12.500h13M20.500 15.500s1.300 1.800 1.300 2.900a1.300 1.300 0 1 1-2.600 0c0-1.100 1.300-2.900 1.300-2.900z",
  doorway: "M3.500 20.500h17M6.500 20.500V3.500h11v17M14 12v1.500",
  cut: "M4.500 5.500h15v13h-15zM12 2.500v3M12 8v2.500M12 13.500V16M12 18.500v3",
  merge: "M4 5.500h5.500c2 0 2.500 1.500 2.500 3.500v11M20 5.500h-5.500c-2 0-2.500 1.500-2.500 3.500M8.700 16.700L12 20l3.300-3.300",
  look: "M11 18.500a7.500 7.500 0 1 0 0-15 7.500 7.500 0 0 0 0 15zM16.500 16.500L21 21",
  erase: "M9 19.500h11M5 14.800l8.800-8.800a1.800 1.800 0 0 1 2.600 0l3.100 3.100a1.800 1.800 0 0 1 0 2.600l-7.700 7.800H9.200L5 15.400a.5.5 0 0 1 0-.6zM9.700 10.300l5.600 5.600",
  undo: "M8.500 5L4 9.500 8.500 14M4.500 9.500H14a5.200 5.200 0 0 1 0 10.400h-3",
  redo: "M15.500 5L20 9.500 15.500 14M19.500 9.500H10a5.200 5.200 0 0 0 0 10.400h3",
  swipe: "M12 3v18M8.500 8.500L5 12l3.500 3.500M15.500 8.500L19 12l-3.500 3.500",
  side: "M3.500 5.500h17v13h-17zM12 5.500v13",
  sun: "M12 16.200a4.200 4.200 0 1 0 0-8.400 4.200 4.200 0 0 0 0 8.400zM12 2.500v2M12 19.500v2M2.500 12h2M19.500 12h2M5.300 5.300l1.400 1.400M17.300 17.300l1.400 1.400M5.300 18.700l1.400-1.400M17.300 6.700l1.400-1.400",
  help: "M12 21a9 9 0 1 0 0-18 9 9 0 0 0 0 18zM9.500 9.300a2.600 2.600 0 0 1 5 .8c0 1.800-2.500 2.100-2.500 3.900M12 17h.01",
  plus: "M12 5v14M5 12h14",
  minus: "M5 12h14",
  fit: "M4 9V4h5M15 4h5v5M20 15v5h-5M9 20H4v-5",
  next: "M9 5l7 7-7 7",
  cross: "M6.500 6.500l11 11M17.500 6.500l-11 11",
  pen: "M4 20l1-4.500L15.500 5a1.800 1.800 0 0 1 2.500 0l1 1a1.800 1.800 0 0 1 0 2.500L8.500 19zM13.500 7l3.500 3.500",
  check: "M5 12.500l4.500 4.500L19 7.500",
};

/** An icon by its name. */
export function icon(name) {
  const space = "http://www.w3.org/2000/svg";
  const svg = document.createElementNS(space, "svg");
  svg.setAttribute("viewBox", "0 0 24 24");
  svg.setAttribute("class", "icon");
  svg.setAttribute("aria-hidden", "true");
  const path = document.createElementNS(space, "path");
  path.setAttribute("d", SHAPES[name]);
  svg.append(path);
  return svg;
}

/** A square of a colour. */
export function swatch(colour) {
  const element = h("i", { className: "swatch" });
  element.style.background = colour;
  return element;
}
