// The status: what the studio is doing, how far it is, and what a person should know.

import { h, byId } from "./dom.js";

export class Status {
  constructor(studio) {
    this.studio = studio;
  }

  render() {
    const { studio } = this;
    const status = byId("status");
    const { learner, relabelling } = studio.state ?? { learner: {} };
    let [kind, words] = ["idle", "Up to date"];
    if (studio.offline && !studio.state) [kind, words] = ["failed", "The studio does not answer"];
    else if (studio.offline) [kind, words] = ["failed", ended(studio.refused)];
    else if (studio.slow.size) [kind, words] = ["working", "Painting"];
    else if (learner.problem) [kind, words] = ["failed", learner.problem];
    else if (learner.working) [kind, words] = ["working", `Labelling: ${learner.stage || "begins"}${learner.fraction > 0.01 ? ` ${Math.round(100 * learner.fraction)} %` : ""}`];
    else if (!relabelling) [kind, words] = ["waiting", "Paint two classes to begin"];
    byId("agrees").hidden = typeof relabelling?.agrees !== "number";
    if (!byId("agrees").hidden) byId("agrees").replaceChildren(share(relabelling.agrees), h("span", {}, " agree"));
    const busy = kind === "working" && learner.working;
    byId("progress").hidden = !busy;
    byId("progress").style.setProperty("--done", busy ? overall(learner) : 0);
    status.className = `status ${kind}`;
    if (status.dataset.words !== words) {
      status.dataset.words = words;
      status.title = words;
      status.replaceChildren(h("i"), words);
    }
    status.dataset.revision = relabelling?.revision ?? -1;
    byId("notices").replaceChildren(...(studio.state?.notices ?? []).map((notice) => h("p", {}, notice)));
    if (studio.offline && studio.state) byId("notices").append(h("p", {}, ...moved(studio.offline)));
    if (studio.state?.tabs > 1) byId("notices").append(h("p", {}, `This studio is open in ${studio.state.tabs} tabs; they share one painting and one undo.`));
  }
}

/** How much of all stages is done, as far as that is known: each stage is half of what is left. */
function overall({ stages, fraction }) {
  const before = 1 - 0.6 ** Math.max(0, stages - 1);
  return before + (1 - before) * 0.4 * fraction;
}

/** A share in percent that is 100 % only if it is. */
function share(value) {
  return value < 1 && value > 0.9995 ? "> 99.9 %" : `${(100 * value).toFixed(1)} %`;
}

function ended(refused) {
  if (!refused) return "The studio has stopped; all edits are saved";
  return `The studio has stopped; ${refused === 1 ? "1 later edit was" : `${refused} later edits were`} not saved`;
}

/** The address of the studio that replaced this one, or a hint to find it. */
function moved({ refused, address }) {
  if (address) return ["The studio was started again. ", h("a", { href: address }, "Go on in the new one.")];
  if (refused) return ["The studio was started again. This tab cannot know its address; it is the one that was printed."];
  return ["If the studio was started again, this tab cannot know where; its address is the one that was printed."];
}
