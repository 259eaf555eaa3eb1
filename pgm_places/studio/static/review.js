// The panel of places to check: by doubt times area, most of it first.

import { h, icon, swatch } from "./dom.js";

export class Review {
  constructor(studio) {
    this.studio = studio;
    this.element = h("div", { className: "panel" });
    this.at = -1; // where in the list the last place was when it was chosen
  }

  render(state) {
    const { checks } = this.studio.places;
    if (this.studio.chosen !== this.last) {
      this.last = this.studio.chosen;
      this.at = checks.findIndex((check) => check.id === this.last);
    }
    const key = JSON.stringify([this.studio.placesVersion, this.studio.chosen, state.classes, !!state.lesson]);
    if (key === this.key) return;
    this.key = key;
    const total = checks.reduce((sum, check) => sum + check.doubtful_m2, 0);
    const next = h("button", { className: "button primary", type: "button", disabled: !checks.length }, "Next place", h("kbd", {}, "N"), icon("next"));
    next.addEventListener("click", () => this.next(1));
    this.element.replaceChildren(
      h("section", {}, h("h2", {}, "Where to look"),
        h("p", { className: "small" }, checks.length
          ? `${total.toFixed(1)} m² are expected to be wrong, most of it in the first places. Confirm a place, or give it another class.`
          : state.lesson ? "No probabilities are known for these labels." : "The list appears once the map has been labelled."),
        next),
      h("ul", { className: "checks" }, checks.map((check, k) => this.#row(check, k))),
    );
  }

  #row(check, k) {
    const chosen = this.studio.chosen === check.id ? " chosen" : "";
    const doubt = `${Math.round(100 * check.doubt)} % in doubt`;
    const row = h("button", { className: `check${chosen}`, type: "button", "aria-current": chosen ? "true" : "false" },
      swatch(this.studio.colours.of(check.label)),
      h("b", {}, check.name),
      h("small", {}, check.second_label ? `${doubt}, perhaps ${check.second_label}` : doubt),
      h("span", { className: "amount" }, `${check.doubtful_m2.toFixed(1)} m²`));
    row.addEventListener("click", () => this.go(k));
    return h("li", {}, row);
  }

  next(step) {
    const { checks } = this.studio.places;
    if (!checks.length) return;
    // A place that was corrected has left for the end of the list, and another one has moved up.
    const stays = this.at < 0 || checks[this.at]?.id === this.studio.chosen;
    const k = stays || step < 0 ? this.at + step : this.at;
    this.go((k + 2 * checks.length) % checks.length);
  }

  go(k) {
    const check = this.studio.places.checks[k];
    this.studio.goTo(check.id);
    this.element.querySelector(".check.chosen")?.scrollIntoView({ block: "nearest" });
  }
}
