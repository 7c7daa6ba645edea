// The graph, live: a box per stage with its state, a row per output with its rate, and the edges.
// Outputs and edges are buttons that show their topic.
import { bytes, count, milliseconds, rate, setText, svg } from "./dom";
import { layOut } from "./layout";
import { Rates, isSilent, traffic, type GraphState, type Stage } from "./state";

const kWidth = 150;
const kStep = 186;
const kHead = 38;
const kRow = 20;
const kMargin = 8;

export class GraphView {
  readonly element = svg("svg", { class: "graph", role: "group", "aria-label": "the graph" });
  private shape = ""; // what the drawing was made of
  private readonly rates = new Rates();
  private updates: ((state: GraphState) => void)[] = [];
  private readonly marked = new Map<string, Element[]>(); // by topic

  constructor(
    private readonly open: (topic: string) => void,
    private readonly openStage: (stage: string) => void,
  ) {}

  update(state: GraphState): void {
    const shape = JSON.stringify(state.stages.map((stage) =>
      [stage.name, stage.kind, stage.inputs, stage.outputs]));
    if (shape !== this.shape) {
      this.shape = shape;
      this.rates.clear();
      this.build(state);
    }
    for (const update of this.updates) update(state);
  }

  // Topics that panes show.
  mark(topics: Set<string>): void {
    for (const [topic, elements] of this.marked)
      for (const element of elements) element.classList.toggle("shown", topics.has(topic));
  }

  private build(state: GraphState): void {
    this.updates = [];
    this.marked.clear();
    const stages = state.stages;
    const inputsHeight = (stage: Stage) => kHead + kRow * Math.max(stage.outputs.length, 0) + 6;
    const edges = stages.flatMap((to) => to.inputs.map((input, i) => {
      const from = stages.find((stage) => stage.name === input.stage)!;
      const row = from.outputs.findIndex((output) => output.topic === input.topic);
      const height = inputsHeight(to);
      return { input, output: from.outputs[row], from, to,
        wire: { from: from.name, to: to.name, out: kHead + kRow * row + kRow / 2,
          into: 8 + ((height - 16) * (i + 0.5)) / to.inputs.length } };
    }));
    const placed = layOut(stages.map((stage) => ({ name: stage.name, height: inputsHeight(stage) })),
      edges.map((edge) => edge.wire), kWidth, kStep);
    const width = placed.width + 2 * kMargin;
    const height = placed.height + 2 * kMargin;
    this.element.setAttribute("viewBox", `${-kMargin} ${-kMargin} ${width} ${height}`);
    this.element.setAttribute("width", String(width));
    this.element.setAttribute("height", String(height));
    this.element.replaceChildren(
      ...edges.map((edge, i) => this.edge(edge, placed.paths[i])),
      ...stages.map((stage) => {
        const at = placed.boxes.get(stage.name)!;
        return this.box(stage, at.x, at.y, inputsHeight(stage));
      }));
  }

  private button(topic: string, label: string, ...children: Node[]): SVGGElement {
    const element = svg("g", { class: "topic", tabindex: 0, role: "button", "aria-label": label,
      onclick: () => this.open(topic),
      onkeydown: (event: KeyboardEvent) => {
        if (event.key !== "Enter") return;
        event.preventDefault();
        this.open(topic);
      } }, ...children);
    this.marked.set(topic, [...(this.marked.get(topic) ?? []), element]);
    return element;
  }

  private edge(edge: any, path: string): Node {
    const line = svg("path", { class: edge.output.latched ? "wire latched" : "wire", d: path });
    const title = svg("title", {}, `${edge.output.topic}: ${edge.output.type}, ` +
      `${edge.from.name} to ${edge.to.name}`);
    const element = this.button(edge.output.topic, `edge ${edge.output.topic}`, title,
      svg("path", { class: "reach", d: path }), line);
    element.setAttribute("tabindex", "-1"); // the output's row is in the tab order
    return element;
  }

  private box(stage: Stage, x: number, y: number, height: number): Node {
    const dot = svg("circle", { cx: 13, cy: 14, r: 4.5, class: "dot" });
    const detail = svg("text", { x: 10, y: 31, class: "detail" });
    const failed = svg("text", { x: kWidth - 10, y: 18, class: "failed" });
    const tip = svg("title");
    const rows = stage.outputs.map((output, row) => {
      const number = svg("text", { x: kWidth - 10, y: 14, class: "rate" });
      const hint = svg("title");
      this.updates.push((state) => {
        const now = state.stages.find((s) => s.name === stage.name)!;
        const { messages, bytes: size } = traffic(now, output);
        const perSecond = this.rates.add(output.topic, messages, state.time);
        const flow = this.rates.add(`${output.topic} bytes`, size, state.time);
        setText(number, output.latched ? "latched" : rate(perSecond));
        setText(hint, `${output.topic}: ${output.type}, ${messages} messages` +
          (flow > 0 ? `, ${bytes(flow)}/s` : ""));
      });
      const element = this.button(output.topic, `${output.topic}, ${output.type}`, hint,
        svg("rect", { x: 1, y: 0, width: kWidth - 2, height: kRow, class: "row" }),
        svg("text", { x: 10, y: 14, class: "port" }, output.port), number,
        svg("circle", { cx: kWidth, cy: kRow / 2, r: 3, class: "plug" }));
      element.setAttribute("transform", `translate(0 ${kHead + kRow * row})`);
      return element;
    });
    const ask = () => this.openStage(stage.name);
    const head = svg("g", { class: "head", tabindex: 0, role: "button",
      "aria-label": `stage ${stage.name}`, onclick: ask,
      onkeydown: (event: KeyboardEvent) => {
        if (event.key !== "Enter") return;
        event.preventDefault();
        ask();
      } }, tip,
      svg("rect", { x: 1, y: 1, width: kWidth - 2, height: kHead - 2, rx: 6, class: "row" }), dot,
      svg("text", { x: 24, y: 18, class: "name" }, stage.name), detail, failed);
    const element = svg("g", { class: "stage", transform: `translate(${x} ${y})` },
      svg("rect", { width: kWidth, height, rx: 7, class: "box" }), head, ...rows);
    this.updates.push((state) => {
      const status = state.stages.find((s) => s.name === stage.name)!.status;
      const shown = status === null ? "unknown"
        : state.state === "ended" || state.state === "silent" ? "stopped"
        : state.state !== "file" && isSilent(status) ? "silent" : status.state;
      element.setAttribute("data-state", shown);
      setText(detail, status === null ? "not heard of"
        : `${shown}${status.latency_median > 0 ? ` · ${milliseconds(status.latency_median)}` : ""}`);
      setText(failed, status !== null && status.frames_failed > 0
        ? `${count(status.frames_failed)} failed` : "");
      setText(tip, [`${stage.name} (${stage.kind})`, status?.host && `on ${status.host}`,
        status && `${status.frames_out} frames, ${bytes(status.memory)}`, status?.activity,
        ...state.stages.find((s) => s.name === stage.name)!.params
          .filter((param) => param.value !== param.default)
          .map((param) => `${param.name} = ${param.value}`),
      ].filter(Boolean).join("\n"));
    });
    return element;
  }
}
