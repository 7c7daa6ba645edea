// Plots, in the page's colours.
import uPlot from "uplot";
import { figure, h, milliseconds } from "./dom";
import type { Chart } from "./views";
import { lineColour } from "./colours";
import type { GraphState } from "./state";

function style(name: string): string {
  return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
}

function axis(extra: Partial<uPlot.Axis> = {}): uPlot.Axis {
  return {
    stroke: style("--soft"), font: "11px system-ui, sans-serif", size: 22, gap: 3,
    grid: { stroke: style("--line"), width: 1 }, ticks: { show: false }, ...extra,
  };
}

function own(colour: string): string {
  return colour.startsWith("--") ? style(colour) : colour;
}

function translucent(colour: string): string {
  return `color-mix(in srgb, ${colour} 35%, transparent)`;
}

// A small chart with its title above.
export function smallChart(chart: Chart, width: number, height: number): HTMLElement {
  const holder = h("figure", { class: "chart" }, h("figcaption", {}, chart.title));
  const plot = new uPlot({
    width, height,
    legend: { show: false },
    cursor: { show: false },
    padding: [4, 6, 0, 0],
    scales: { x: { time: false }, y: { range: (_, low, high) => [Math.min(0, low), high || 1] } },
    axes: [axis({ space: 40 }), axis({ size: 34, space: 26,
      values: (_, values) => values.map((v) => figure(v)) })],
    series: [{}, ...chart.series.map((series): uPlot.Series => ({
      label: series.label, stroke: own(series.colour), width: 1.5, points: { show: false },
      fill: series.filled ? translucent(own(series.colour)) : undefined,
      paths: series.filled && chart.x.length <= 80 ? uPlot.paths.stepped!({ align: 1 }) : undefined,
    }))],
  }, [chart.x, ...chart.series.map((series) => series.values)] as uPlot.AlignedData, holder);
  holder.setAttribute("role", "img");
  holder.setAttribute("aria-label", chart.title);
  (holder as any).dispose = () => plot.destroy();
  return holder;
}

const kSpan = 120; // s that are shown
const kPeriod = 1000; // ms between two points

// How long each stage works on a frame, over the last minutes.
export class LatencyPlot {
  readonly element = h("div", { class: "latency" });
  private plot: uPlot | null = null;
  private names: string[] = [];
  private times: number[] = [];
  private values: (number | null)[][] = [];
  private last = new Map<string, { sum: number; frames: number }>();
  private since = 0;

  constructor() {
    new ResizeObserver(() => this.plot?.setSize(this.size())).observe(this.element);
  }

  colour(stage: string): string {
    return lineColour(this.names.indexOf(stage), document.documentElement.dataset.theme === "dark");
  }

  update(state: GraphState): void {
    const names = state.stages.filter((stage) => stage.inputs.length + stage.outputs.length > 0)
      .map((stage) => stage.name);
    if (names.join() !== this.names.join()) this.reset(names);
    if (state.time - this.since < kPeriod) return;
    this.since = state.time;
    this.times.push(state.time / 1000);
    names.forEach((name, s) => {
      const status = state.stages.find((stage) => stage.name === name)!.status;
      this.values[s].push(status === null ? null : this.mean(name, status));
    });
    while (this.times.length > 2 && this.times.at(-1)! - this.times[0] > kSpan) {
      this.times.shift();
      for (const list of this.values) list.shift();
    }
    this.plot?.setData(this.data());
  }

  // Times in seconds before now.
  private data(): uPlot.AlignedData {
    const now = this.times.at(-1) ?? 0;
    return [this.times.map((time) => time - now), ...this.values] as uPlot.AlignedData;
  }

  // In other colours.
  redraw(): void {
    if (this.names.length > 0) this.build();
  }

  // Over the frames since it was last asked; nothing if there were none.
  private mean(name: string, status: any): number | null {
    const frames = status.frames_out + status.frames_failed;
    const before = this.last.get(name);
    this.last.set(name, { sum: status.latency_sum, frames });
    if (before === undefined || frames <= before.frames) return null;
    return (status.latency_sum - before.sum) / (frames - before.frames);
  }

  private reset(names: string[]): void {
    this.names = names;
    this.times = [];
    this.values = names.map(() => []);
    this.last.clear();
    this.build();
  }

  private size(): { width: number; height: number } {
    const box = this.element.getBoundingClientRect();
    return { width: Math.max(120, box.width), height: 150 };
  }

  private build(): void {
    this.plot?.destroy();
    this.plot = new uPlot({
      ...this.size(),
      legend: { show: false },
      cursor: { show: false },
      padding: [8, 14, 0, 0],
      scales: {
        x: { time: false, range: (_, low) => [Math.min(low ?? 0, -kSpan / 4), 0] },
        y: { distr: 3, range: (_, low, high) => [
          10 ** Math.floor(Math.log10(Math.max(0.1, low || 1))),
          10 ** Math.ceil(Math.log10(Math.max(1, high || 1)))] },
      },
      axes: [
        axis({ incrs: [10, 30], space: 50,
          values: (_, values) => values.map((v) => (v === 0 ? "now" : `−${-v} s`)) }),
        axis({ size: 48, values: (_, values) => values.map((v) =>
          v !== null && Number.isInteger(Math.log10(v)) ? milliseconds(v).replace(".0", "") : "") }),
      ],
      series: [{}, ...this.names.map((name): uPlot.Series => ({
        label: name, stroke: this.colour(name), width: 1.5, spanGaps: true,
        points: { show: false },
      }))],
    }, this.data(), this.element);
  }
}
