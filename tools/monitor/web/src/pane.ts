// One pane: a topic of the current frame in 3D, with legend, facts, charts and a table beside it.
import { css } from "./colours";
import { smallChart } from "./charts";
import { h, replace, setText } from "./dom";
import type { Frame, Frames } from "./frames";
import { Scene } from "./scene";
import { upstream, type GraphState, type Topic } from "./state";
import {
  canShow, makeView, needs, needsLater, type Choice, type Context, type Legend, type View,
} from "./views";

// What panes see of the page.
export interface Surroundings {
  readonly frames: Frames;
  state(): GraphState | null;
  topics(): Topic[];
}

const kMaxRows = 400; // of the dump of a message that has no view

export class Pane {
  readonly element: HTMLElement;
  readonly scene: Scene;
  topic = "";
  onTopic: () => void = () => {};
  onClose: () => void = () => {};
  onFocus: () => void = () => {};

  private readonly select = h("select", { "aria-label": "topic", onchange: () => {
    this.show(this.select.value);
    this.onTopic();
  } });
  private readonly choices = h("span", { class: "choices" });
  private readonly legend = h("div", { class: "legend" });
  private readonly facts = h("div", { class: "facts" });
  private readonly picked = h("div", { class: "picked", role: "status" });
  private readonly notice = h("div", { class: "notice" });
  private readonly side = h("div", { class: "side" });
  private readonly chosen = new Map<string, string>();
  private readonly kept = new Map<string, unknown>();
  private view: View | null = null;
  private point: number | null = null;
  private shown: { frame: Frame | null; parts: number; topic: string; latched: any } | null = null;
  private options = "";

  constructor(private readonly around: Surroundings) {
    const stage = h("div", { class: "canvas" }, this.legend, this.notice, this.picked);
    this.element = h("section", { class: "pane", tabindex: -1 },
      h("header", {}, this.select, this.choices,
        h("button", { class: "close", title: "Close this pane (x)", "aria-label": "close this pane",
          onclick: () => this.onClose() }, "×")),
      h("div", { class: "body" }, stage, this.side), this.facts);
    this.element.addEventListener("pointerdown", () => this.onFocus(), true);
    this.element.addEventListener("focusin", () => this.onFocus());
    this.scene = new Scene(stage);
    this.scene.onPick = (point) => {
      this.point = point;
      this.renderPoint();
    };
  }

  dispose(): void {
    this.scene.dispose();
    this.element.remove();
  }

  show(topic: string): void {
    if (topic === this.topic) return;
    this.topic = topic;
    this.point = null;
    this.kept.clear();
    this.shown = null;
  }

  // Topics whose messages this pane needs.
  wanted(): string[] {
    const own = this.around.topics().find((topic) => topic.name === this.topic);
    if (own === undefined) return [];
    const before = this.before(own);
    return [own.name, ...before, ...this.later(own).map((topic) => topic.name)];
  }

  // Whether the frame has all that this pane shows of it, with what other branches of the graph say
  // of it or without.
  isComplete(frame: Frame, withLater: boolean): boolean {
    const own = this.around.topics().find((topic) => topic.name === this.topic);
    if (own === undefined || own.latched) return true;
    return frame.has(own.name) && this.before(own).every((topic) => frame.has(topic)) &&
      (!withLater ||
        this.later(own).every((topic) => topic.latched || frame.has(topic.name)));
  }

  cycle(direction: number, last: boolean): void {
    const choices = this.view?.choices ?? [];
    const choice = last ? choices.at(-1) : choices[0];
    if (choice === undefined) return;
    const at = choice.options.indexOf(this.chosen.get(choice.key) ?? choice.options[0]);
    const next = (at + direction + choice.options.length) % choice.options.length;
    this.choose(choice.key, choice.options[next]);
  }

  // Draws what is new: the frame, its parts, the topic.
  update(frame: Frame | null): void {
    this.updateOptions();
    const own = this.around.topics().find((topic) => topic.name === this.topic);
    const latched = own?.latched ? this.around.frames.latest(this.topic) : null;
    const parts = frame?.messages.size ?? 0;
    const same = this.shown !== null && this.shown.frame === frame && this.shown.parts === parts &&
      this.shown.topic === this.topic && this.shown.latched === latched;
    if (same) return;
    this.shown = { frame, parts, topic: this.topic, latched };
    this.render(own, frame, latched);
  }

  redraw(): void {
    this.shown = null;
  }

  fit(): void {
    this.scene.fit(this.view?.origin ?? [0, 0, 0]);
  }

  private later(own: Topic): Topic[] {
    const types = needsLater(own.type);
    return this.around.topics().filter((topic) => types.includes(topic.type));
  }

  private before(own: Topic): string[] {
    const state = this.around.state();
    if (state === null) return [];
    const wanted = needs(own.type);
    // In a file there is no graph: everything belongs together.
    const names = state.stages.length === 0 ? this.around.topics().map((topic) => topic.name)
      : upstream(state, own.stage);
    const found = names.map((name) => this.around.topics().find((topic) => topic.name === name))
      .filter((topic): topic is Topic => topic !== undefined && topic.name !== own.name &&
        !topic.latched && wanted.includes(topic.type));
    // The nearest of each type, but all clouds: a message tells by its size which one it means.
    return found.filter((topic, i) => topic.type === "Cloud" ||
      found.findIndex((other) => other.type === topic.type) === i).map((topic) => topic.name);
  }

  private context(own: Topic, frame: Frame | null): Context {
    const typeOf = (name: string) =>
      this.around.topics().find((topic) => topic.name === name)?.type;
    const before = this.before(own);
    return {
      find: (type) => before.filter((name) => typeOf(name) === type)
        .map((name) => frame?.get(name)).filter((message) => message != null),
      latched: (type) => {
        const topic = this.around.topics().find((one) => one.latched && one.type === type);
        return topic === undefined ? null : this.around.frames.latest(topic.name);
      },
      later: (type) => {
        const topic = this.around.topics().find((one) => one.type === type && frame?.has(one.name));
        return topic === undefined ? null : frame!.get(topic.name);
      },
      choose: (choice) => {
        const chosen = this.chosen.get(choice.key);
        return chosen !== undefined && choice.options.includes(chosen) ? chosen : choice.options[0];
      },
      keep: <T>(key: string, make: () => T) => {
        if (!this.kept.has(key)) this.kept.set(key, make());
        return this.kept.get(key) as T;
      },
    };
  }

  private choose(key: string, option: string): void {
    this.chosen.set(key, option);
    this.shown = null;
  }

  private render(own: Topic | undefined, frame: Frame | null, latched: any): void {
    const message = own === undefined ? null : own.latched ? latched : frame?.get(own.name) ?? null;
    this.view = null;
    if (own !== undefined && message !== null && canShow(own.type)) {
      try {
        this.view = makeView(own.type, message, this.context(own, frame));
      } catch (error) {
        this.say(`This message cannot be drawn: ${(error as Error).message}`);
      }
    }
    const view = this.view;
    this.scene.show(view?.xyz ?? null, view?.colour ?? new Uint8Array(), view?.origin ?? [0, 0, 0]);
    const points = view?.xyz == null ? 0 : view.xyz.length / 3;
    this.element.setAttribute("data-points", String(points));
    this.element.setAttribute("data-type", own?.type ?? "");
    this.element.setAttribute("data-frame", frame?.name ?? "");
    this.element.classList.toggle("flat", view !== null ? view.xyz === null
      : message !== null);
    this.renderChoices(view?.choices ?? []);
    replace(this.legend, ...(points === 0 ? [] : view!.legends.map(renderLegend)));
    replace(this.facts, ...(view?.facts ?? []).map((fact) => h("span", {}, fact)));
    if (this.point !== null && this.point >= points) this.point = null;
    this.clearSide();
    if (view !== null) this.say("");
    else if (own === undefined) this.say("Choose a topic: click an edge or an output of the graph.");
    else if (message === null) this.say(this.missing(own, frame));
    else if (!canShow(own.type)) this.renderDump(message);
    this.renderPoint();
  }

  private missing(own: Topic, frame: Frame | null): string {
    if (own.latched || frame === null) return `Waiting for ${own.name} …`;
    const failure = this.around.state()?.failures.find((one) =>
      one.sequence === frame.sequence && one.frame === frame.name);
    return failure === undefined ? `This frame has no ${own.type} here (yet).`
      : `This frame failed at ${failure.stage}: ${failure.reason}`;
  }

  private say(text: string): void {
    setText(this.notice, text);
    this.notice.hidden = text === "";
  }

  private renderPoint(): void {
    const told = this.view !== null && this.point !== null ? this.view.describe(this.point) : null;
    setText(this.picked, told?.text ?? "");
    if (this.view !== null) this.renderSide(told?.chart);
  }

  private clearSide(): void {
    for (const chart of this.side.querySelectorAll(".chart")) (chart as any).dispose?.();
    this.side.replaceChildren();
    this.side.hidden = true;
  }

  private renderSide(extra: View["charts"][number] | undefined): void {
    this.clearSide();
    const view = this.view!;
    const charts = extra === undefined ? view.charts : [extra, ...view.charts.slice(1)];
    if (charts.length === 0 && view.table === undefined && view.xyz !== null) return;
    this.side.hidden = false;
    const columns = charts.length > 1 ? Math.max(1, Math.floor(this.side.clientWidth / 180)) : 1;
    const width = Math.min(420, Math.floor((this.side.clientWidth - 16) / columns) - 6);
    const height = charts.length > 1 ? 92 : 130;
    replace(this.side,
      ...(view.xyz === null ? view.legends.map((one) =>
        h("div", { class: "legend" }, renderLegend(one))) : []),
      view.chartTitle === undefined ? null : h("p", { class: "caption" }, view.chartTitle),
      charts.length === 0 ? null : h("div", { class: "charts" },
        ...charts.map((chart) => smallChart(chart, width, height))),
      view.table === undefined ? null : renderTable(view.table));
    this.side.hidden = this.side.childElementCount === 0;
  }

  private renderDump(message: any): void {
    const lines = dump(message, "").slice(0, kMaxRows);
    this.say("");
    this.side.hidden = false;
    replace(this.side, h("pre", {}, lines.join("\n")));
  }

  private renderChoices(choices: Choice[]): void {
    replace(this.choices, ...choices.filter((choice) => choice.options.length > 1).map((choice) => {
      const current = this.chosen.get(choice.key) ?? choice.options[0];
      const select = h("select", { "aria-label": choice.label,
        onchange: () => this.choose(choice.key, select.value) },
        ...choice.options.map((option) =>
          h("option", { value: option, selected: option === current }, option)));
      return h("label", {}, choice.label, select);
    }));
  }

  private updateOptions(): void {
    const topics = this.around.topics();
    const key = topics.map((topic) => topic.name).join() + this.topic;
    if (key === this.options) return;
    this.options = key;
    const shorten = (name: string) => name.slice(name.indexOf("/") + 1);
    replace(this.select,
      topics.some((topic) => topic.name === this.topic) ? null
        : h("option", { value: "", selected: true }, "no topic"),
      ...topics.map((topic) => h("option", { value: topic.name,
        selected: topic.name === this.topic }, `${shorten(topic.name)} · ${topic.type}`)));
  }
}

function renderLegend(legend: Legend): HTMLElement {
  if (legend.kind === "items")
    return h("ul", {}, ...legend.items.map((item) => h("li", {}, swatch(item.colour), item.label,
      item.note === undefined ? null : h("small", {}, item.note))));
  const bar = h("canvas", { width: 128, height: 1, class: "ramp" });
  const context = bar.getContext("2d")!;
  for (let i = 0; i < 128; ++i) {
    context.fillStyle = css(legend.ramp(i / 127));
    context.fillRect(i, 0, 1, 1);
  }
  return h("div", { class: "scale" }, h("span", {}, legend.label), bar,
    h("span", { class: "ends" }, h("small", {}, legend.low), h("small", {}, legend.high)));
}

function swatch(colour: string): HTMLElement {
  const element = h("i", { class: "swatch" });
  element.style.backgroundColor = colour;
  return element;
}

function renderTable(table: NonNullable<View["table"]>): HTMLElement {
  return h("div", { class: "table" }, h("table", {},
    h("thead", {}, h("tr", {}, ...table.columns.map((name) => h("th", { scope: "col" }, name)))),
    h("tbody", {}, ...table.rows.map((row) => h("tr", {}, h("th", { scope: "row" }, row.head),
      ...row.cells.map((cell) => {
        const element = h("td", {}, cell.text);
        if (cell.share !== undefined && cell.colour !== undefined) {
          const colour = css(cell.colour).replace(")", " / 0.4)");
          element.style.backgroundImage = `linear-gradient(${colour}, ${colour})`;
          element.style.backgroundSize = `${100 * cell.share}% 100%`;
        }
        return element;
      }))))));
}

// A message as lines of text, long arrays cut.
function dump(value: any, name: string, depth = 0): string[] {
  const indent = "  ".repeat(depth);
  const label = name === "" ? "" : `${name}: `;
  if (value === null || typeof value !== "object") return [`${indent}${label}${value}`];
  if (Array.isArray(value) || ArrayBuffer.isView(value)) {
    const list = Array.from(value as ArrayLike<any>);
    if (list.length > 0 && typeof list[0] === "object")
      return [`${indent}${label}${list.length}`,
        ...list.flatMap((one, i) => dump(one, String(i), depth + 1))];
    const head = list.slice(0, 12).join(", ");
    return [`${indent}${label}[${head}${list.length > 12 ? `, … ${list.length} in all` : ""}]`];
  }
  const entries = Object.entries(value);
  return [...(name === "" ? [] : [`${indent}${name}`]),
    ...entries.flatMap(([key, one]) => dump(one, key, depth + (name === "" ? 0 : 1)))];
}
