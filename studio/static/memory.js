// The memory: tool, layers and comparison of a map, as they were before the page was loaded again.

export class Memory {
  constructor(studio) {
    this.studio = studio;
    this.key = null;
    this.saved = "";
  }

  /** Restore the stored view of a map. */
  recall(name) {
    this.key = `view:${name}`;
    const { studio } = this;
    const found = read(this.key);
    if (!found) return;
    Object.assign(studio.layers.shown, numbers(found.shown, studio.layers.shown));
    if (typeof found.value === "string") studio.layers.value = found.value;
    for (const side of ["left", "right"]) {
      if (found.sources?.[side] in studio.state.sources) studio.layers.sources[side] = found.sources[side];
    }
    if (found.radius >= 0.5 && found.radius <= 200) studio.tools.radius = found.radius;
    if (Number.isInteger(found.label) && found.label < studio.state.classes.length) studio.label = found.label;
    if (typeof found.tool === "string") studio.tools.choose(found.tool);
    if (["divider", "side"].includes(found.way)) studio.swipe.set(found.way);
  }

  /** Keep how the map is looked at, where that has changed. */
  keep() {
    if (!this.key) return;
    const { layers, tools, swipe, label } = this.studio;
    const { shown, value, sources } = layers;
    const text = JSON.stringify({ shown, value, sources, label, tool: tools.name, radius: tools.radius, way: swipe.way });
    if (text === this.saved) return;
    this.saved = text;
    try {
      localStorage.setItem(this.key, text);
    } catch {
      // Without storage, the view is not restored.
    }
  }
}

function read(key) {
  try {
    return JSON.parse(localStorage.getItem(key));
  } catch {
    return null;
  }
}

/** Those of the values that are numbers from 0 to 1 under a known name. */
function numbers(values, known) {
  return Object.fromEntries(Object.entries(values ?? {}).filter(([name, value]) => name in known && value >= 0 && value <= 1));
}
