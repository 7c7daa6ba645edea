// The graph as the server describes it, and what follows from it. See docs/monitor.md.

// Of one process.
export interface Status {
  process: string;
  heard_ms_ago: number;
  state: string;
  activity: string;
  progress: number;
  generation: number;
  host: string;
  pid: number;
  frame: string;
  sequence: number;
  frames_in: number;
  frames_out: number;
  frames_failed: number;
  queue: number;
  latency_median: number;
  latency_p99: number;
  latency_sum: number;
  cpu_seconds: number;
  memory: number;
  account: { admitted: number; labelled: number; consumed: number; failed: number; dropped: number };
  ports: { name: string; topic: string; output: boolean; messages: number; bytes: number }[];
}

export interface Param {
  name: string;
  value: string;
  default?: string;
  unit?: string;
  doc?: string;
  choices?: string[];
}

export interface Output {
  port: string;
  topic: string;
  type: string;
  latched: boolean;
}

export interface Stage {
  name: string;
  kind: string;
  host: string;
  inputs: { port: string; stage: string; topic: string }[];
  outputs: Output[];
  params: Param[];
  processes: Status[];
  status: Status | null; // of all processes together
}

export interface Failure {
  stage: string;
  frame: string;
  sequence: number;
  reason: string;
  time: number;
}

export interface FrameEntry {
  epoch: string;
  sequence: number;
  name: string;
  time: number; // ms since 1970 when it began, 0 if that is not known
}

export interface GraphState {
  graph: string;
  instance?: string;
  state: "waiting" | "running" | "finished" | "silent" | "ended" | "file";
  time: number; // ms since 1970
  window?: number;
  agents?: boolean; // there is somebody who can swap stages
  note?: string; // what people should know: the swap that goes on, what a file lacks
  // Of a file: all its frames, the parts in which they can be had (their first frames), and which
  // frame is to be shown first.
  frames?: FrameEntry[];
  parts?: number[];
  first?: number;
  stages: Stage[];
  failures: Failure[];
  failure_count?: number;
}

export interface Topic {
  name: string;
  type: string;
  latched: boolean;
  stage: string;
}

// What came from the server, with what follows from it.
export function complete(received: any): GraphState {
  for (const stage of received.stages) stage.status = together(stage.processes);
  return received;
}

const kSilentAfter = 1500; // ms; statuses come several times a second
const kOver = ["failed", "stopped", "finished"];

export function isSilent(status: Status): boolean {
  return status.heard_ms_ago > kSilentAfter && !kOver.includes(status.state);
}

// The replicas of a stage as one: counts are added, of latencies the longest counts, of states the
// worst.
function together(processes: Status[]): Status | null {
  if (processes.length < 2) return processes[0] ?? null;
  const sum = (of: (status: Status) => number) => processes.reduce((a, one) => a + of(one), 0);
  const most = (of: (status: Status) => number) => Math.max(...processes.map(of));
  const order = ["failed", "working", "waiting", "starting"];
  const worst = [...processes].sort((a, b) =>
    (order.indexOf(a.state) + 9) % 9 - (order.indexOf(b.state) + 9) % 9)[0];
  const account = { ...worst.account };
  for (const key of Object.keys(account) as (keyof typeof account)[])
    account[key] = sum((one) => one.account[key]);
  return {
    ...worst, account,
    heard_ms_ago: most((one) => one.heard_ms_ago),
    host: [...new Set(processes.map((one) => one.host))].join(", "),
    frames_in: sum((one) => one.frames_in), frames_out: sum((one) => one.frames_out),
    frames_failed: sum((one) => one.frames_failed), queue: sum((one) => one.queue),
    latency_median: most((one) => one.latency_median),
    latency_p99: most((one) => one.latency_p99),
    latency_sum: sum((one) => one.latency_sum),
    cpu_seconds: sum((one) => one.cpu_seconds), memory: sum((one) => one.memory),
    ports: processes.flatMap((one) => one.ports),
  };
}

// Topics, nearest first, whose messages came about before those of `stage`: what its inputs take,
// what the stages before it take, and so on.
export function upstream(state: GraphState, stage: string): string[] {
  const found: string[] = [];
  const seen = new Set([stage]);
  const open = [stage];
  for (let name = open.shift(); name !== undefined; name = open.shift()) {
    for (const input of state.stages.find((s) => s.name === name)?.inputs ?? []) {
      if (!found.includes(input.topic)) found.push(input.topic);
      if (!seen.has(input.stage)) {
        seen.add(input.stage);
        open.push(input.stage);
      }
    }
  }
  return found;
}

// Rates from counters that only grow, over a window of time.
export class Rates {
  private readonly history = new Map<string, { time: number; value: number }[]>();

  // Per second over the last seconds.
  add(name: string, value: number, time: number): number {
    let samples = this.history.get(name);
    if (samples === undefined) this.history.set(name, (samples = []));
    const last = samples.at(-1);
    if (last !== undefined && value < last.value) samples.length = 0; // began anew
    if (last === undefined || time > last.time) samples.push({ time, value });
    while (samples.length > 2 && time - samples[0].time > 5000) samples.shift();
    if (samples.length < 2) return 0;
    const first = samples[0];
    const newest = samples.at(-1)!;
    return newest.time > first.time
      ? (1000 * (newest.value - first.value)) / (newest.time - first.time) : 0;
  }

  clear(): void {
    this.history.clear();
  }
}

export function isSameRun(a: GraphState, b: GraphState): boolean {
  const first = (state: GraphState) => `${state.frames?.[0]?.epoch} ${state.frames?.length}`;
  return a.graph === b.graph && a.instance === b.instance && first(a) === first(b);
}

// The parts of a file with frame number `at` and its neighbours, as far as `margin` frames away.
export function partsAround(state: GraphState, at: number, margin: number): number[] {
  const starts = state.parts ?? [];
  const partOf = (frame: number) =>
    Math.max(0, starts.findLastIndex((start) => start <= frame));
  return starts.length === 0 ? []
    : [...new Set([at, at + margin, at - margin].map(partOf))];
}

// The frames of a part: from the first to before the last.
export function framesOf(state: GraphState, part: number): { from: number; to: number } {
  return { from: state.parts![part], to: state.parts![part + 1] ?? state.frames!.length };
}

// Messages and bytes that a topic's publisher has sent; bytes are unknown if it does not count them.
export function traffic(stage: Stage, output: Output): { messages: number; bytes: number } {
  const ports = stage.status?.ports.filter((p) => p.output && p.topic === output.topic) ?? [];
  if (ports.length > 0)
    return { messages: ports.reduce((sum, p) => sum + p.messages, 0),
      bytes: ports.reduce((sum, p) => sum + p.bytes, 0) };
  const messages = output.latched ? 0
    : Math.max(stage.status?.frames_out ?? 0, stage.status?.account.admitted ?? 0);
  return { messages, bytes: 0 };
}
