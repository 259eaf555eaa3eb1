// The panel of answers: why this label, and what can be done about the region.

import { h, swatch } from "./dom.js";

export class Why {
  constructor(studio) {
    this.studio = studio;
    this.element = h("div", { className: "panel" });
    this.cell = null;
    this.reasons = null;
    this.showsScan = true;
  }

  render(state) {
    const key = JSON.stringify([this.cell, this.reasons?.questions, this.showsScan, this.studio.chosen, this.studio.placesVersion, state.classes]);
    const writes = this.element.querySelector("input:not([type=checkbox]):focus"); // a name is being written
    if (key === this.key || writes) return;
    this.key = key;
    const region = this.studio.places.byId.get(this.studio.chosen);
    if (!region && !this.cell) {
      this.element.replaceChildren(h("p", { className: "muted" }, "Choose the hand and click on the map: this panel then shows why a cell has its label, and the facts of its region."));
      return;
    }
    this.element.replaceChildren(
      ...[this.#head(), region ? this.#region(region, state) : null, this.cell ? this.#cell(this.cell) : null].flat().filter(Boolean),
    );
  }

  /** What is drawn on the map, with a switch, and a way to be rid of it. */
  #head() {
    const close = h("button", { className: "button", type: "button" }, "Close", h("kbd", {}, "Esc"));
    close.addEventListener("click", () => this.studio.forget());
    const scan = h("input", { type: "checkbox", role: "switch", checked: this.showsScan });
    scan.addEventListener("change", () => {
      this.showsScan = scan.checked;
      this.studio.changed();
    });
    const legend = this.reasons ? h("label", { className: "switch" }, scan, h("i", { className: "scan-legend" }), "Its scan") : h("span");
    return h("div", { className: "row between" }, legend, close);
  }

  #region(region, state) {
    const { studio } = this;
    const field = h("input", { className: "field", value: region.name, "aria-label": "Name of the region", maxLength: 100 });
    const form = h("form", { className: "row" }, swatch(studio.colours.of(region.class)), field, h("button", { className: "button" }, "Rename"));
    form.addEventListener("submit", (event) => {
      event.preventDefault();
      field.blur();
      studio.edit({ kind: "rename", point_m: region.anchor_m, name: field.value.trim() });
    });
    const chips = state.classes.map((item, k) => {
      const chip = h("button", { className: "chip", type: "button" }, swatch(item.colour), item.name, k < 9 ? h("kbd", {}, `⇧${k + 1}`) : null);
      chip.addEventListener("click", () => studio.fillChosen(k));
      return chip;
    });
    const near = studio.places.beside(region).map((other) => other.name);
    const facts = [
      ["Area", `${region.area_m2.toFixed(1)} m²`],
      ["Outline", `${region.perimeter_m.toFixed(1)} m`],
      ["Clearance at its middle", `${region.clearance_m.toFixed(2)} m`],
      ["Next to", near.join(", ") || "nothing"],
    ];
    if (region.gate) facts.push(["Gate", `${region.gate.width_m.toFixed(2)} m wide`]);
    const split = h("button", { className: "button", type: "button" }, "Split by a doorway");
    split.addEventListener("click", () => studio.tools.choose("doorway"));
    const merge = h("button", { className: "button", type: "button" }, "Merge with another");
    merge.addEventListener("click", () => {
      studio.tools.choose("merge");
      studio.tools.click(region.anchor, region);
    });
    return [
      h("section", {}, h("h2", {}, "Region"), form),
      h("section", {}, h("h2", {}, "It is a"), h("div", { className: "chips" }, chips)),
      region.probabilities ? h("section", {}, h("h2", {}, "Mean probability"), this.#bars(this.#named(region.probabilities, state))) : null,
      h("section", {}, h("dl", { className: "facts" }, facts.flatMap(([name, value]) => [h("dt", {}, name), h("dd", {}, value)]))),
      h("div", { className: "chips" }, merge, split),
    ];
  }

  #named(values, state) {
    const known = state.relabelling?.known ?? [];
    return Object.fromEntries(values.map((value, k) => [state.classes[known[k]]?.name ?? "?", value]));
  }

  #cell(cell) {
    const where = `${cell.x_m.toFixed(2)}, ${cell.y_m.toFixed(2)} m`;
    if (cell.ground !== "free") return [h("section", {}, h("h2", {}, `Cell at ${where}`), h("p", {}, `The map says ${cell.ground} here; only free cells have labels.`))];
    const parts = [h("hr", { className: "rule" }), h("section", {}, h("h2", {}, `Cell at ${where}`), h("p", { className: "note" }, this.#story(cell)))];
    if (cell.probabilities) parts.push(h("section", {}, h("h2", {}, "With its neighbours"), this.#bars(cell.probabilities)));
    if (cell.unary_probabilities) parts.push(h("section", {}, h("h2", {}, "By itself"), this.#bars(cell.unary_probabilities)));
    if (this.reasons && !this.reasons.painted) parts.push(...this.#votes(this.reasons));
    return parts;
  }

  /** What spoke for and against each class, in the order in which the list asks. */
  #votes({ questions, gate_probability: gate, networks, pulls, doorway_log_odds: added }) {
    const parts = questions.map((question) =>
      h("section", {}, h("h2", {}, `Is it ${question.label}? ${signed(question.log_odds)}`),
        h("p", { className: "small" }, `Its scan adds ${signed(question.from_scan)}, the space around it ${signed(question.from_spaces)} (log-odds).`),
        h("dl", { className: "facts" }, question.votes.flatMap((vote) => [
          h("dt", {}, vote.name),
          h("dd", { title: `It weighs most at ${withUnit(vote.threshold, vote.unit)}` }, `${withUnit(vote.value, vote.unit)}  `, h("b", {}, signed(vote.log_odds))),
        ]))));
    if (networks) parts.unshift(h("section", {}, h("h2", {}, "By the floor networks"), this.#bars(networks)));
    const notes = [];
    if (gate) notes.push(`The gate here is a doorway with ${percent(gate)}.`);
    if (added < 0) notes.push(`Where the accepted gates are adds ${signed(added)} to the log-odds of a doorway.`);
    const against = pulls.filter((pull) => pull.towards < 0).length;
    const towards = pulls.filter((pull) => pull.towards > 0).length;
    if (towards || against) notes.push(`${towards} neighbours pulled it to its label, ${against} away from it.`);
    if (notes.length) parts.push(h("p", { className: "note" }, notes.join(" ")));
    return parts;
  }

  #story({ paint, label, unary, truth }) {
    const against = truth && label && truth !== label ? ` The labels to compare with have ${truth}.` : "";
    if (paint) return `You painted it ${paint}, and every method keeps to that.${against}`;
    if (!label) return "It has no label yet.";
    if (label === unary) return `By itself it looks like ${unary}, and its neighbours agree.${against}`;
    return `By itself it looks like ${unary}; its neighbours made it ${label}.${against}`;
  }

  #bars(probabilities) {
    const rows = Object.entries(probabilities).sort((a, b) => b[1] - a[1]);
    return h("div", { className: "bars" }, rows.flatMap(([name, value]) => {
      const fill = h("i");
      fill.style.width = `${100 * value}%`;
      fill.style.background = this.studio.colours.of(name);
      return [h("span", {}, name), h("span", { className: "track" }, fill), h("span", {}, percent(value))];
    }));
  }
}

const signed = (value) => (value < 0 ? "−" : "+") + Math.abs(value).toFixed(2);
const short = (value) => (Math.abs(value) >= 100 ? value.toFixed(0) : Number(value.toPrecision(3)).toString());
const withUnit = (value, unit) => (unit ? `${short(value)} ${unit}` : short(value));

/** A probability in a table: never 0 % or 100 % unless it is. */
export function percent(value) {
  if (value > 0 && value < 0.005) return "< 1 %";
  if (value < 1 && value > 0.995) return "> 99 %";
  return `${Math.round(100 * value)} %`;
}
