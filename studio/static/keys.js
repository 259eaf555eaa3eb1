// Keys: every command of the studio without a mouse.

import { h, byId } from "./dom.js";
import { TOOLS } from "./tools.js";

const LISTED = [
  ["Choose a class", "1 – 9"], ["Eraser", "0"],
  ...TOOLS.map((tool) => [tool.words.split(":")[0], tool.key.toUpperCase()]),
  ["Smaller or larger brush", "[  ]"], ["Close the polygon", "Enter, Shift Enter"], ["Take back a corner", "Backspace"], ["Cancel, close “Why”", "Esc"],
  ["Undo", "Ctrl Z"], ["Redo", "Ctrl Shift Z"],
  ["Next, previous place to check", "N, Shift N"], ["Confirm the place", "C"], ["Split the place into the rooms that it could be", "A"],
  ["Give the place a class", "Shift 1 – 9"], ["Divider", "S"], ["Side by side", "Shift S"], ["Show errors", "X"],
  ["Move the map", "Shift arrows, Space"], ["Move the cross of a tool", "Arrows"], ["Set a point, begin and end a stroke", "Enter"], ["Zoom", "+  −"], ["Show all", "Home"], ["This list", "?"],
];

export class Keys {
  constructor(studio, view, pointer) {
    Object.assign(this, { studio, view, pointer });
    window.addEventListener("keydown", (event) => this.#press(event));
    window.addEventListener("keyup", (event) => {
      if (event.code === "Space") pointer.space = false;
    });
  }

  #press(event) {
    const { target } = event;
    if (target.matches("input:not([type=checkbox]):not([type=range]), textarea, select") || document.querySelector("dialog[open]")) return;
    const key = typed(event);
    const third = event.getModifierState("AltGraph") || (event.altKey && /^[[\]]$/.test(key)); // AltGr, Option
    const command = (event.ctrlKey || event.metaKey) && !third;
    if (command && key === "z") this.#take(event, () => (event.shiftKey ? this.studio.redo() : this.studio.undo()));
    else if (command && key === "y") this.#take(event, () => this.studio.redo());
    if (command || (event.altKey && !third)) return;
    const digit = third ? undefined : /^Digit(\d)$/.exec(event.code)?.[1]; // by position: AZERTY needs Shift to type them
    if (digit !== undefined) this.#take(event, () => this.#digit(Number(digit), event.shiftKey));
    else if (event.code === "Space" && target === this.view.canvas) this.#take(event, () => (this.pointer.space = true));
    else this.#letter(event, key);
  }

  #digit(digit, shift) {
    const label = digit - 1;
    if (label >= this.studio.state.classes.length) return;
    if (shift && label >= 0) this.studio.fillChosen(label);
    else if (!shift) this.studio.chooseLabel(label);
  }

  #letter(event, key) {
    const { studio, view } = this;
    const tool = TOOLS.find((item) => item.key === key);
    const onMap = event.target === view.canvas || event.target === document.body;
    const moves = { ArrowLeft: [80, 0], ArrowRight: [-80, 0], ArrowUp: [0, 80], ArrowDown: [0, -80] };
    const commands = {
      n: () => studio.review.next(event.shiftKey ? -1 : 1),
      c: () => studio.confirm(),
      a: () => studio.review.split(),
      s: () => studio.swipe.toggle(event.shiftKey ? "side" : "divider"),
      x: () => studio.layers.flip("errors"),
      "[": () => studio.resize(1 / 1.25),
      "]": () => studio.resize(1.25),
      "+": () => view.zoom(1.4),
      "=": () => view.zoom(1.4),
      "-": () => view.zoom(1 / 1.4),
      Home: () => view.showAll(),
      Escape: () => studio.escape(),
      Backspace: () => studio.tools.takeBack(),
      "?": () => help(),
    };
    const draws = studio.tools.name !== "look" && !event.shiftKey;
    if (tool) this.#take(event, () => studio.tools.choose(tool.name));
    else if (moves[key] && onMap && draws) this.#take(event, () => studio.cross.move(-moves[key][0] / 80, -moves[key][1] / 80));
    else if (moves[key] && onMap) this.#take(event, () => view.move(...moves[key]));
    else if (key === "Enter" && onMap) this.#take(event, () => (event.shiftKey || !studio.cross.press()) && studio.tools.close());
    else if (commands[key]) this.#take(event, commands[key]);
  }

  #take(event, action) {
    event.preventDefault();
    action();
  }
}

/** What a key types, small; of alphabets other than the Latin one, the letter that is printed there in English. */
function typed(event) {
  if (event.key.length > 1) return event.key;
  const letter = /^Key([A-Z])$/.exec(event.code)?.[1];
  const isLatin = event.key.charCodeAt(0) < 128;
  return (letter && !isLatin ? letter : event.key).toLowerCase();
}

/** Show the list of keys. */
export function help() {
  const dialog = byId("help");
  const close = h("button", { className: "button primary", type: "button" }, "Close");
  close.addEventListener("click", () => dialog.close());
  dialog.replaceChildren(
    h("div", { className: "row between" }, h("h2", { id: "help-title" }, "Keys"), close),
    h("dl", { className: "keys" }, LISTED.map(([words, keys]) => h("div", {}, h("dt", {}, words), h("dd", {}, h("kbd", {}, keys))))),
  );
  dialog.showModal();
}
