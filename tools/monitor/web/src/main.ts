// The page: what is heard from the server, and the graph, panes and figures that show it.
import "uplot/dist/uPlot.min.css";
import "./style.css";
import { LatencyPlot } from "./charts";
import { Connection, type Channel } from "./connection";
import { bytes, count, h, milliseconds, rate, replace, setText } from "./dom";
import { Frames, type Frame } from "./frames";
import { GraphView } from "./graph_view";
import { Pane } from "./pane";
import { StageDialog, type SwapCall } from "./stage_dialog";
import {
  Rates, complete, framesOf, isSameRun, partsAround, type Failure, type GraphState, type Topic,
} from "./state";
import { canShow } from "./views";

const kMaxPanes = 4;
const kDark = matchMedia("(prefers-color-scheme: dark)");
const kUsualPause = 500; // ms between frames whose times are not known
const kLongestPause = 2000;
const kPatience = 1000;
const kHaste = 250; // ms between two fetches
const kMargin = 10; // frames of a file that are fetched ahead
const kFirstTopics = ["Labelling", "Segments", "Cloud", "AppearanceModel"];

const kKeys: [string, string][] = [
  ["← →", "previous, next frame"],
  ["Home End", "first, last frame"],
  ["Space", "hold the frame, or follow the newest; of a file: play, stop"],
  ["1 – 9", "topic of the pane in use"],
  ["c C", "next, previous colouring"],
  ["[ ]", "previous, next eigenfunction (or last choice)"],
  ["p x", "open, close a pane"],
  ["n", "next pane"],
  ["o", "the stage of the pane in use: its processes, its swap"],
  ["w a s d", "turn the view"],
  ["q e", "nearer, farther"],
  ["+ -", "larger, smaller points"],
  ["f", "look at everything, from the sensor"],
  ["l", "link the cameras, or not"],
  ["g", "show the graph, or not"],
  ["t", "light, dark"],
  ["?", "this list"],
];

class Page {
  readonly frames = new Frames();
  private graph: GraphState | null = null;
  private channels: Channel[] = [];
  private connected = false;
  private everConnected = false;
  private dropped = 0;
  private panes: Pane[] = [];
  private active: Pane | null = null;
  private current: Frame | null = null;
  private live = true; // follows the newest frame; of a file: plays
  private linked = true;
  private pointSize = 1;
  private stateChanged = true;
  private subscribed = "";
  private readonly rates = new Rates();

  private readonly graphView = new GraphView((topic) => this.open(topic),
    (stage) => this.openStage(stage));
  private readonly latency = new LatencyPlot();
  private readonly title = h("h1", {}, "cosegraph");
  private readonly pill = h("span", { class: "pill", role: "status" });
  private readonly account = h("span", { class: "account" });
  private readonly missed = h("span", { class: "missed" });
  private readonly banner = h("div", { class: "banner", role: "alert", hidden: true });
  private readonly problem = h("div", { class: "banner problem", role: "alert", hidden: true });
  private readonly graphHolder = h("div", { class: "graph-holder" }, this.graphView.element);
  private readonly grid = h("main", { class: "panes" });
  private readonly stages = h("tbody");
  private readonly failures = h("ol", { class: "failures" });
  private readonly failureCount = h("span", { class: "number" });
  private readonly sidebar = h("aside", {},
    h("h2", {}, "Latency"), this.latency.element,
    h("table", { class: "stages" },
      h("thead", {}, h("tr", {}, ...["stage", "median", "p99", "frames", "memory"].map((name) =>
        h("th", { scope: "col" }, name)))), this.stages),
    h("h2", {}, "Failures", this.failureCount), this.failures);
  private readonly slider = h("input", { type: "range", min: 0, max: 0, value: 0,
    "aria-label": "frame", oninput: () => this.jump(Number(this.slider.value)) });
  private readonly frameName = h("span", { class: "frame-name" });
  private readonly follow = h("button", { class: "follow", onclick: () => this.toggleLive() });
  private readonly footer = h("footer", {}, this.follow, this.slider, this.frameName);
  private readonly linkButton = h("button", { title: "Link the cameras (l)",
    onclick: () => this.toggleLink() }, "linked");
  private readonly help = h("dialog", { class: "help" }, h("h2", {}, "Keys"),
    h("dl", {}, ...kKeys.flatMap(([key, what]) => [
      h("dt", {}, ...key.split(" ").map((one) =>
        one === "–" ? one : h("kbd", {}, one))), h("dd", {}, what)])),
    h("p", {}, "Drag to turn, right button to move, wheel to zoom; click a point to ask about it."),
    h("form", { method: "dialog" }, h("button", {}, "Close")));

  private readonly stageDialog = new StageDialog(() => this.swapCall());
  private readonly connection: Connection;

  constructor() {
    document.body.append(
      h("header", { class: "top" }, this.title, this.pill, this.account, this.missed,
        h("span", { class: "tools" },
          h("button", { title: "Open another pane (p)", onclick: () => this.addPane() }, "+ pane"),
          this.linkButton,
          h("button", { title: "Light or dark (t)", "aria-label": "light or dark",
            onclick: () => this.toggleTheme() }, "◐"),
          h("button", { title: "Keys (?)", "aria-label": "keys",
            onclick: () => this.help.showModal() }, "?"))),
      this.banner, this.problem, this.graphHolder,
      h("div", { class: "work" }, this.grid, this.sidebar), this.footer, this.help,
      this.stageDialog.element);
    kDark.addEventListener("change", () => this.retheme());
    document.addEventListener("keydown", (event) => this.key(event));
    this.addPane();
    this.retheme();
    const scheme = location.protocol === "https:" ? "wss:" : "ws:";
    this.connection = new Connection(`${scheme}//${location.host}/${location.search}`, {
      connected: () => {
        this.connected = this.everConnected = true;
        this.subscribed = "";
        this.stateChanged = true;
      },
      lost: () => {
        this.connected = false;
        this.dropped = 0;
        this.stateChanged = true;
      },
      channels: (all) => this.hearChannels(all),
      message: (channel, data) => this.take(channel, data),
      dropped: (sum) => {
        this.dropped = sum;
        this.stateChanged = true;
      },
      problem: (text) => {
        setText(this.problem, text);
        this.problem.hidden = false;
        setTimeout(() => (this.problem.hidden = true), 8000);
      },
    });
    const tick = () => {
      requestAnimationFrame(tick);
      this.tick();
    };
    tick();
  }

  state(): GraphState | null {
    return this.graph;
  }

  // Those that panes can show; what has a drawing first.
  topics(): Topic[] {
    return this.listed;
  }
  private listed: Topic[] = [];

  // -- what is heard -----------------------------------------------------------------------------

  private hearChannels(all: Channel[]): void {
    this.channels = all;
    this.stateChanged = true;
    this.list();
  }

  private isFile(): boolean {
    return this.graph?.state === "file";
  }

  private isState(channel: Channel): boolean {
    return channel.type === "cosegraph.Monitor";
  }

  private take(channel: Channel, data: Uint8Array): void {
    if (this.isState(channel)) {
      const before = this.graph;
      this.graph = complete(channel.decode(data));
      this.stateChanged = true;
      if (before === null || !isSameRun(before, this.graph)) this.begin();
      return;
    }
    const latched = this.listed.find((topic) => topic.name === channel.topic)?.latched ?? false;
    this.frames.add(channel, data, latched);
  }

  // Another run, or the first.
  private begin(): void {
    this.frames.begin(this.graph!.frames ?? null);
    this.current = this.frames.all[this.graph!.first ?? 0] ?? null;
    this.live = !this.isFile();
    setText(this.follow, this.isFile() ? "play" : "live");
    this.follow.title = this.isFile() ? "Play (space)" : "Follow the newest frame (space)";
    this.rates.clear();
    this.list();
    for (const pane of this.panes) pane.redraw();
    this.subscribed = "";
  }

  private list(): void {
    const outputs = this.graph?.stages.flatMap((stage) =>
      stage.outputs.map((output) => ({ ...output, stage: stage.name }))) ?? [];
    this.listed = this.channels
      .filter((channel) => !this.isState(channel) && !channel.type.startsWith("foxglove"))
      .map((channel) => {
        const output = outputs.find((one) => one.topic === channel.topic);
        return { name: channel.topic, type: channel.type, stage: output?.stage ?? "",
          latched: output?.latched ?? (channel.type === "AppearanceModel" ||
            channel.type === "RelationModel") };
      })
      .sort((a, b) => Number(canShow(b.type)) - Number(canShow(a.type)));
    if (this.graph === null) return;
    if (this.panes.length === 1 && this.panes[0].topic === "") {
      const types = kFirstTopics.filter((type) => this.listed.some((topic) => topic.type === type));
      const first = this.listed.find((topic) => topic.type === types[0]);
      if (first !== undefined) this.panes[0].show(first.name);
      const second = this.listed.find((topic) => topic.type === types[1]);
      if (second !== undefined && innerWidth > 900) this.addPane(second.name);
    }
  }

  // -- panes -------------------------------------------------------------------------------------

  private addPane(topic = ""): void {
    if (this.panes.length >= kMaxPanes) return;
    const pane = new Pane(this);
    pane.onFocus = () => this.activate(pane);
    pane.onClose = () => this.closePane(pane);
    pane.scene.onCamera = (scene) => {
      if (this.linked)
        for (const other of this.panes) if (other.scene !== scene) other.scene.follow(scene);
    };
    const model = this.panes.find((other) => other.scene.hasView());
    if (model !== undefined) pane.scene.follow(model.scene);
    pane.show(topic || this.active?.topic || "");
    pane.scene.setSize(this.pointSize);
    this.panes.push(pane);
    this.grid.append(pane.element);
    this.grid.dataset.count = String(this.panes.length);
    this.activate(pane);
    this.retheme();
  }

  private closePane(pane: Pane): void {
    if (this.panes.length === 1) return;
    this.panes = this.panes.filter((other) => other !== pane);
    pane.dispose();
    this.grid.dataset.count = String(this.panes.length);
    if (this.active === pane) this.activate(this.panes[0]);
    this.stateChanged = true;
  }

  private activate(pane: Pane): void {
    this.active = pane;
    for (const other of this.panes) other.element.classList.toggle("active", other === pane);
  }

  private open(topic: string): void {
    const already = this.panes.find((pane) => pane.topic === topic);
    if (already !== undefined) return this.activate(already);
    this.active?.show(topic);
    this.stateChanged = true;
  }

  private openStage(name: string): void {
    const stage = this.graph?.stages.find((one) => one.name === name);
    if (stage !== undefined) this.stageDialog.open(stage);
  }

  // Asks for a swap, or why that cannot be.
  private swapCall(): SwapCall | string {
    if (this.graph === null || !this.connected) return "There is no connection to the monitor.";
    if (this.graph.state === "file") return "This is a recording.";
    if (this.graph.state === "ended") return "The graph has ended.";
    const service = `${this.graph.graph}/swap`;
    if (!this.connection.offers(service)) return "This monitor only looks on (--read-only).";
    if (!this.graph.agents)
      return "Stages can be swapped in graphs that run by 'cosegraph up' or agents; this one runs " +
        "in one process.";
    return (request) => this.connection.call(service, request);
  }

  // -- frames ------------------------------------------------------------------------------------

  private jump(index: number): void {
    const frame = this.frames.all[index];
    if (frame === undefined) return;
    this.current = frame;
    this.live = false;
  }

  private step(by: number): void {
    const at = this.current === null ? -1 : this.frames.all.indexOf(this.current);
    this.jump(Math.min(this.frames.all.length - 1, Math.max(0, at + by)));
  }

  private toggleLive(): void {
    this.live = !this.live;
    this.played = performance.now();
    if (this.live && this.isFile() && this.current === this.frames.all.at(-1)) {
      this.jump(0); // over again
      this.live = true;
    }
  }

  private isComplete(frame: Frame, withLater: boolean): boolean {
    return this.panes.every((pane) => pane.isComplete(frame, withLater));
  }

  // Of a running graph the newest frame of which every pane has all it shows, so that panes never
  // flicker between two.
  private chooseFrame(): void {
    const all = this.frames.all;
    if (this.current !== null && !all.includes(this.current)) this.current = all[0] ?? null;
    if (!this.live) return;
    if (this.isFile()) return this.play();
    const find = (withLater: boolean) => all.findLast((frame) => this.isComplete(frame, withLater));
    this.current = find(true) ?? find(false) ?? this.current ?? all.at(-1) ?? null;
  }

  // Goes on to the next frame of a file when its time has come, and it has come in. Frames that
  // lack something, as those that failed, are waited for a while.
  private played = 0; // when the last step was due
  private play(): void {
    const all = this.frames.all;
    const at = this.current === null ? -1 : all.indexOf(this.current);
    const next = all[at + 1];
    if (next === undefined) {
      this.live = false;
      return;
    }
    const pause = next.time > 0 && this.current !== null
      ? Math.min(kLongestPause, Math.max(0, next.time - this.current.time)) : kUsualPause;
    const late = performance.now() - this.played - pause;
    if (late < 0 || (!this.isComplete(next, false) && late < kPatience)) return;
    this.current = next;
    this.played = late > kUsualPause ? performance.now() : this.played + pause;
  }

  // -- drawing -----------------------------------------------------------------------------------

  private tick(): void {
    this.subscribe();
    this.chooseFrame();
    for (const pane of this.panes) {
      pane.update(this.current);
      pane.scene.draw();
    }
    this.renderFrames();
    if (!this.stateChanged) return;
    this.stateChanged = false;
    this.renderState();
  }

  private subscribe(): void {
    const wanted = new Set(this.panes.flatMap((pane) => pane.wanted()));
    for (const channel of this.channels) if (this.isState(channel)) wanted.add(channel.topic);
    const at = Math.max(0, this.current === null ? 0 : this.frames.all.indexOf(this.current));
    const parts = this.graph === null ? [] : partsAround(this.graph, at, kMargin);
    const key = [...wanted].sort().join() + parts.join();
    if (key === this.subscribed || this.isHasty(parts)) return;
    this.subscribed = key;
    if (this.isFile()) this.frames.keep(parts.map((part) => framesOf(this.graph!, part)));
    this.connection.want(wanted, parts);
    this.graphView.mark(new Set(this.panes.map((pane) => pane.topic)));
  }

  // Parts that the slider only passes through are not fetched.
  private parts = "";
  private fetched = 0;
  private isHasty(parts: number[]): boolean {
    const isNew = parts.join() !== this.parts;
    if (isNew && performance.now() - this.fetched < kHaste) return true;
    if (isNew) {
      this.parts = parts.join();
      this.fetched = performance.now();
    }
    return false;
  }

  private shownFrames = "";
  private renderFrames(): void {
    const all = this.frames.all;
    const at = this.current === null ? 0 : all.indexOf(this.current);
    const key = `${this.current?.key} ${at} ${all.length} ${this.live}`;
    if (key === this.shownFrames) return;
    this.shownFrames = key;
    this.slider.max = String(Math.max(0, all.length - 1));
    this.slider.value = String(at);
    this.slider.disabled = all.length < 2;
    this.follow.setAttribute("aria-pressed", String(this.live));
    setText(this.frameName, this.current === null ? "no frame yet"
      : `${this.current.name} · ${at + 1} of ${all.length}` + this.manner(this.current));
  }

  // How it comes that this frame is shown.
  private manner(frame: Frame): string {
    if (!this.isFile()) return this.live ? "" : ", held";
    const first = this.frames.all[0].time;
    return first === 0 ? "" : `, ${((frame.time - first) / 1000).toFixed(1)} s`;
  }

  private renderState(): void {
    const graph = this.graph;
    this.renderConnection(graph);
    if (graph === null) return;
    setText(this.title, graph.graph);
    document.title = `${graph.graph} · cosegraph`;
    const isWired = graph.stages.length > 0;
    this.graphHolder.classList.toggle("absent", !isWired);
    this.sidebar.hidden = !isWired;
    this.latency.element.hidden = this.isFile();
    if (!isWired) return;
    this.graphView.update(graph);
    this.stageDialog.update(graph);
    this.graphView.mark(new Set(this.panes.map((pane) => pane.topic)));
    this.latency.update(graph);
    this.renderAccount(graph);
    this.renderStages(graph);
    this.renderFailures(graph);
  }

  private renderConnection(graph: GraphState | null): void {
    const state = this.connected ? graph?.state ?? "waiting" : "lost";
    this.pill.dataset.state = state;
    setText(this.pill, { waiting: "waiting", running: "running", finished: "finished",
      silent: "silent", ended: "ended", file: "file", lost: "no connection" }[state]);
    const text = {
      lost: this.everConnected
        ? "The connection to the monitor is lost. Trying again …"
        : "Connecting to the monitor … If this stays, is it running, and is the token right?",
      silent: "Nothing has been heard of the graph for some seconds.",
      ended: "The graph has ended. Its last frames stay here; the next run is shown when it starts.",
      waiting: graph === null ? "" : "Waiting for the graph: no stage has been heard yet.",
    }[state as string] ?? graph?.note ?? "";
    setText(this.banner, text);
    this.banner.hidden = text === "";
    setText(this.missed, this.dropped === 0 ? ""
      : `${count(this.dropped)} messages left out for this browser`);
  }

  private renderAccount(graph: GraphState): void {
    const sums = { admitted: 0, labelled: 0, consumed: 0, failed: 0, dropped: 0 };
    for (const stage of graph.stages)
      for (const key of Object.keys(sums) as (keyof typeof sums)[])
        sums[key] += stage.status?.account[key] ?? 0;
    const over = sums.labelled + sums.consumed + sums.failed;
    const perSecond = this.rates.add("over", over, graph.time);
    const part = (value: number, name: string) => value > 0 ? `${count(value)} ${name}` : "";
    setText(this.account, [
      `${count(sums.admitted)} admitted`, part(sums.labelled, "labelled"),
      part(sums.consumed, "consumed"), part(sums.failed, "failed"),
      part(sums.admitted - over, "in flight"), part(sums.dropped, "dropped"), rate(perSecond),
    ].filter((text) => text !== "" && text !== "–").join(" · "));
  }

  private renderStages(graph: GraphState): void {
    while (this.stages.childElementCount > graph.stages.length) this.stages.lastChild!.remove();
    graph.stages.forEach((stage, i) => {
      let row = this.stages.children[i] as HTMLElement | undefined;
      if (row === undefined) {
        row = h("tr", {}, h("th", { scope: "row" }, h("i", { class: "swatch" }), h("span")),
          h("td"), h("td"), h("td"), h("td"));
        this.stages.append(row);
      }
      const status = stage.status;
      (row.querySelector(".swatch") as HTMLElement).style.backgroundColor =
        this.latency.colour(stage.name);
      setText(row.querySelector("span")!, stage.name);
      const busy = (status?.frames_out ?? 0) + (status?.frames_failed ?? 0) > 0;
      [busy ? milliseconds(status!.latency_median) : "–",
        busy ? milliseconds(status!.latency_p99) : "–",
        status === null ? "–" : count(Math.max(status.frames_out, status.account.admitted)),
        status === null ? "–" : bytes(status.memory)].forEach((text, column) =>
        setText(row!.children[column + 1], text));
    });
  }

  private shownFailures = "";
  private renderFailures(graph: GraphState): void {
    const total = graph.failure_count ?? graph.failures.length;
    setText(this.failureCount, total > 0 ? count(total) : "");
    const key = `${graph.instance} ${total}`;
    if (key === this.shownFailures) return;
    this.shownFailures = key;
    if (total === 0)
      return replace(this.failures, h("li", { class: "none" },
        graph.state === "file" ? "none" : "none since the monitor began"));
    replace(this.failures, ...[...graph.failures].reverse().slice(0, 50).map((failure) =>
      h("li", {}, this.frameLink(failure), ` at ${failure.stage}`,
        h("time", {}, new Date(failure.time).toLocaleTimeString()),
        h("span", {}, failure.reason))));
  }

  // The name of a frame that failed; of a file a way to get there.
  private frameLink(failure: Failure): HTMLElement {
    const name = failure.frame || `frame ${failure.sequence}`;
    const index = !this.isFile() ? -1 : this.frames.all.findIndex((frame) =>
      frame.sequence === failure.sequence && frame.name === failure.frame);
    return index < 0 ? h("b", {}, name)
      : h("button", { class: "link", title: "Show this frame", onclick: () => this.jump(index) },
        name);
  }

  // -- wishes ------------------------------------------------------------------------------------

  private toggleTheme(): void {
    const dark = document.documentElement.dataset.theme === "dark";
    localStorage.setItem("theme", dark ? "light" : "dark");
    this.retheme();
  }

  // The theme that was chosen here, else the system's.
  private retheme(): void {
    document.documentElement.dataset.theme =
      localStorage.getItem("theme") ?? (kDark.matches ? "dark" : "light");
    const background = getComputedStyle(document.documentElement).getPropertyValue("--canvas").trim();
    for (const pane of this.panes) {
      pane.scene.setBackground(background);
      pane.redraw();
    }
    this.latency.redraw();
  }

  private toggleLink(): void {
    this.linked = !this.linked;
    setText(this.linkButton, this.linked ? "linked" : "unlinked");
    if (this.linked && this.active !== null)
      for (const pane of this.panes) if (pane !== this.active) pane.scene.follow(this.active.scene);
  }

  private resize(factor: number): void {
    this.pointSize = Math.min(8, Math.max(0.2, this.pointSize * factor));
    for (const pane of this.panes) pane.scene.setSize(this.pointSize);
  }

  private key(event: KeyboardEvent): void {
    const target = event.target as Element;
    const typing = target.closest("select, input:not([type=range]), dialog[open]") !== null;
    if (event.ctrlKey || event.metaKey || event.altKey || typing) return;
    const scene = this.active?.scene;
    const kTurn = Math.PI / 24;
    const wishes: Record<string, () => void> = {
      ArrowLeft: () => this.step(-1),
      ArrowRight: () => this.step(1),
      Home: () => this.jump(0),
      End: () => this.jump(this.frames.all.length - 1),
      " ": () => this.toggleLive(),
      c: () => this.active?.cycle(1, false),
      C: () => this.active?.cycle(-1, false),
      "[": () => this.active?.cycle(-1, true),
      "]": () => this.active?.cycle(1, true),
      p: () => this.addPane(),
      o: () => {
        const topic = this.listed.find((one) => one.name === this.active?.topic);
        if (topic !== undefined) this.openStage(topic.stage);
      },
      x: () => this.active !== null && this.closePane(this.active),
      n: () => {
        const next = this.panes[(this.panes.indexOf(this.active!) + 1) % this.panes.length];
        this.activate(next);
        next.element.focus();
      },
      a: () => scene?.turn(-kTurn, 0, 1),
      d: () => scene?.turn(kTurn, 0, 1),
      w: () => scene?.turn(0, kTurn, 1),
      s: () => scene?.turn(0, -kTurn, 1),
      q: () => scene?.turn(0, 0, 1 / 1.15),
      e: () => scene?.turn(0, 0, 1.15),
      "+": () => this.resize(1.2),
      "-": () => this.resize(1 / 1.2),
      f: () => this.active?.fit(),
      l: () => this.toggleLink(),
      g: () => this.graphHolder.classList.toggle("folded"),
      t: () => this.toggleTheme(),
      "?": () => this.help.showModal(),
    };
    if (/^[1-9]$/.test(event.key)) {
      const topic = this.listed[Number(event.key) - 1];
      if (topic !== undefined) this.active?.show(topic.name);
      this.stateChanged = true;
      return;
    }
    const wish = wishes[event.key];
    if (wish === undefined || (event.key === " " && target.closest("button") !== null)) return;
    event.preventDefault();
    wish();
  }
}

new Page();
