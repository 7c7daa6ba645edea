// The graph as the server describes it, and what follows from it. See docs/monitor.md.

export interface Status {
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
  params: Record<string, string>;
  status: Status | null;
}

export interface Failure {
  stage: string;
  frame: string;
  sequence: number;
  reason: string;
  time: number;
}

export interface GraphState {
  graph: string;
  instance?: string;
  state: "waiting" | "running" | "finished" | "silent" | "ended" | "file";
  time: number; // ms since 1970
  window?: number;
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

// Messages and bytes that a topic's publisher has sent; bytes are unknown if it does not count them.
export function traffic(stage: Stage, output: Output): { messages: number; bytes: number } {
  const port = stage.status?.ports.find((p) => p.output && p.topic === output.topic);
  if (port !== undefined) return { messages: port.messages, bytes: port.bytes };
  const messages = output.latched ? 0
    : Math.max(stage.status?.frames_out ?? 0, stage.status?.account.admitted ?? 0);
  return { messages, bytes: 0 };
}
