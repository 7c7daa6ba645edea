// One stage: its processes, its parameters, and its swap with what came of it.
import { bytes, count, h, milliseconds, replace, setText } from "./dom";
import type { Report } from "./connection";
import { isSilent, type GraphState, type Stage } from "./state";

export type SwapCall = (request: object) => Promise<Report>;

export class StageDialog {
  readonly element = h("dialog", { class: "stage-dialog", "aria-labelledby": "stage-name" });
  private name = "";
  private busy = false;
  private readonly title = h("h2", { id: "stage-name" });
  private readonly processes = h("tbody");
  private readonly params = h("div", { class: "params" });
  private readonly hint = h("p", { class: "hint" });
  private readonly result = h("div", { class: "result", role: "status" });
  private readonly tryButton = h("button", { type: "button",
    title: "Start the newcomer, see whether it gets ready, and change nothing",
    onclick: () => this.order(true) }, "Try");
  private readonly swapButton = h("button", { type: "submit", class: "main",
    title: "Replace the stage while frames flow" }, "Swap");
  private kind = h("input", { "aria-label": "kind" });
  private inputs: { name: string; before: string;
    input: HTMLInputElement | HTMLSelectElement }[] = [];

  // `call`: none if stages cannot be swapped here, with the reason.
  constructor(private readonly call: () => SwapCall | string) {
    const form = h("form", { onsubmit: (event: Event) => {
      event.preventDefault();
      this.order(false);
    } },
      h("table", {}, h("thead", {}, h("tr", {},
        ...["process", "state", "host", "frames", "waiting", "median", "memory"].map((name) =>
          h("th", { scope: "col" }, name)))), this.processes),
      h("h3", {}, "Swap"), this.params, this.hint,
      h("div", { class: "buttons" }, this.tryButton, this.swapButton,
        h("button", { type: "button", onclick: () => this.element.close() }, "Close")),
      this.result);
    this.element.append(this.title, form);
  }

  open(stage: Stage): void {
    this.name = stage.name;
    setText(this.title, stage.name);
    replace(this.result);
    this.build(stage);
    this.renderStage(stage);
    if (!this.element.open) this.element.showModal();
  }

  update(state: GraphState): void {
    if (!this.element.open) return;
    const stage = state.stages.find((one) => one.name === this.name);
    if (stage === undefined) return this.element.close();
    this.renderStage(stage);
    if (this.busy && state.note) setText(this.result, `${state.note} …`);
  }

  private build(stage: Stage): void {
    this.kind = h("input", { value: stage.kind, spellcheck: "false" });
    this.inputs = stage.params.map((param) => {
      const input = (param.choices ?? []).length > 0
        ? h("select", {}, ...param.choices!.map((one) =>
          h("option", { value: one, selected: one === param.value }, one)))
        : h("input", { value: param.value, spellcheck: "false" });
      return { name: param.name, before: param.value, input };
    });
    const row = (name: string, field: HTMLElement, unit: string, doc: string) =>
      h("label", { title: doc }, h("span", {}, name), field, h("small", {}, unit),
        h("small", { class: "doc" }, doc));
    replace(this.params, row("kind", this.kind, "", "another kind with the same ports"),
      ...stage.params.map((param, i) =>
        row(param.name, this.inputs[i].input, param.unit ?? "", param.doc ?? "")));
  }

  private renderStage(stage: Stage): void {
    const call = this.call();
    setText(this.hint, typeof call === "string" ? call
      : "The newcomer starts beside the old one and takes over between two frames. If it fails " +
        "the old one stays.");
    this.tryButton.disabled = this.swapButton.disabled = this.busy || typeof call === "string";
    replace(this.processes, ...stage.processes.map((one) => h("tr", {},
      h("th", { scope: "row" }, `${one.process}, generation ${one.generation}`),
      ...[isSilent(one) ? `silent for ${milliseconds(one.heard_ms_ago)}` : one.state,
        `${one.host} (${one.pid})`, count(Math.max(one.frames_out, one.account.admitted)),
        count(one.queue), milliseconds(one.latency_median), bytes(one.memory)].map((text) =>
        h("td", {}, text)))));
  }

  private async order(isTrial: boolean): Promise<void> {
    const call = this.call();
    if (typeof call === "string" || this.busy) return;
    const changed = this.inputs.filter((one) => one.input.value !== one.before);
    const request: Record<string, unknown> = { stage: this.name, dry_run: isTrial,
      params: Object.fromEntries(changed.map((one) => [one.name, one.input.value])) };
    if (this.kind.value !== this.kind.defaultValue) request.use = this.kind.value;
    this.busy = true;
    this.tryButton.disabled = this.swapButton.disabled = true;
    setText(this.result, "asked for …");
    this.result.dataset.outcome = "";
    try {
      this.tell(await call(request), isTrial);
      if (!isTrial) for (const one of changed) one.before = one.input.value;
    } catch (error) {
      this.result.dataset.outcome = "bad";
      replace(this.result, h("p", {}, `${isTrial ? "It would not work" : "Not swapped"}: ` +
        (error as Error).message));
    }
    this.busy = false;
    this.tryButton.disabled = this.swapButton.disabled = false;
  }

  private tell(report: Report, isTrial: boolean): void {
    const number = (key: string) => Number(report[key] ?? 0);
    const isGood = number("lost") + number("doubled") === 0;
    this.result.dataset.outcome = isGood ? "good" : "bad";
    const took = milliseconds(number("took_ms"));
    if (isTrial)
      return replace(this.result, h("p", {},
        `The newcomer would be ready, after ${took}. Nothing was changed.`));
    const facts: [string, string][] = [
      ["generation", `${number("from_generation")} → ${number("to_generation")} in ${took}`],
      ["frames meanwhile", `${count(number("admitted"))} admitted, ${count(number("done"))} done, ` +
        `${count(number("failed"))} failed`],
      ["lost", count(number("lost"))], ["doubled", count(number("doubled"))],
      ["longest pause", `${milliseconds(number("pause_ms"))}, usually ` +
        milliseconds(number("usual_ms"))]];
    replace(this.result, h("dl", {}, ...facts.flatMap(([name, value]) =>
      [h("dt", {}, name), h("dd", {}, value)])));
  }
}
