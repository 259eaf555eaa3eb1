// The theme: the system's, until the switch says otherwise; and colours for the canvas.

export class Theme {
  constructor(changed) {
    this.changed = changed;
    this.dark = window.matchMedia("(prefers-color-scheme: dark)");
    this.chosen = stored();
    this.dark.addEventListener("change", () => this.#apply());
    this.#apply();
  }

  get name() {
    return this.chosen ?? (this.dark.matches ? "dark" : "light");
  }

  toggle() {
    this.chosen = this.name === "dark" ? "light" : "dark";
    try {
      localStorage.setItem("theme", this.chosen);
    } catch {
      // A browser that keeps nothing asks again next time.
    }
    this.#apply();
  }

  #apply() {
    if (this.chosen) document.documentElement.dataset.theme = this.chosen;
    this.changed();
  }

  /** The colours of what is drawn over the map. */
  colours(classes) {
    const style = getComputedStyle(document.documentElement);
    const colour = (name) => style.getPropertyValue(`--${name}`).trim();
    const byName = new Map(classes.map((item) => [item.name, item.colour]));
    return {
      ink: colour("map-ink"),
      halo: colour("halo"),
      outline: colour("outline"),
      accent: colour("accent"),
      gate: byName.get("doorway") ?? colour("accent"),
      of: (name) => byName.get(name) ?? colour("muted"),
      ofLabel: (label) => classes[label]?.colour ?? colour("muted"),
    };
  }
}

function stored() {
  try {
    const name = localStorage.getItem("theme");
    return name === "dark" || name === "light" ? name : null;
  } catch {
    return null;
  }
}
