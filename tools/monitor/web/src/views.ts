// What a message looks like: points with colours, a legend, facts, charts. One function per type of
// message; pure, apart from the principal axes that are kept so that colours stay comparable from
// frame to frame.
import {
  alarm, css, diverging, fill, muted, palette, scattered, sequential, type Ramp, type Rgb,
} from "./colours";
import { count, figure } from "./dom";
import {
  along, histogram, mixtureDensity, otherGroupNearby, principalAxes, quantile, type Basis,
} from "./numbers";

export interface Choice {
  key: string;
  label: string;
  options: string[];
}

export type Legend =
  | { kind: "items"; items: { colour: string; label: string; note?: string }[] }
  | { kind: "ramp"; ramp: Ramp; low: string; high: string; label: string };

export interface Chart {
  title: string;
  x: number[];
  series: { label: string; values: number[]; colour: string; filled?: boolean }[];
  unit?: string;
}

export interface Table {
  columns: string[];
  rows: { head: string; cells: { text: string; share?: number; colour?: Rgb }[] }[];
}

export interface View {
  xyz: Float32Array | null;
  colour: Uint8Array;
  origin: ArrayLike<number>; // of the sensor
  choices: Choice[];
  legends: Legend[];
  facts: string[];
  charts: Chart[];
  chartTitle?: string;
  table?: Table;
  // What is known of one point.
  describe(point: number): { text: string; chart?: Chart };
}

// Where a view finds what it needs beside its own message.
export interface Context {
  // The newest messages of this type that came about before this one (or, of "later" ones, after),
  // of the same frame; nearest first.
  find(type: string): any[];
  latched(type: string): any;
  later(type: string): any;
  choose(choice: Choice): string; // the option that is chosen
  keep<T>(key: string, make: () => T): T; // the same as long as this pane shows this topic
}

const kPlain: Rgb = [120, 144, 168];
const kMissing: Rgb = [150, 150, 155];

function empty(): View {
  return {
    xyz: null, colour: new Uint8Array(), origin: [0, 0, 0], choices: [], legends: [], facts: [],
    charts: [], describe: () => ({ text: "" }),
  };
}

function cloudOf(context: Context, size: number): any {
  return context.find("Cloud").find((cloud) => cloud.xyz.length === 3 * size) ?? null;
}

function onCloud(cloud: any, colour: (i: number) => Rgb): Pick<View, "xyz" | "colour" | "origin"> {
  return { xyz: cloud.xyz, colour: fill(cloud.xyz.length / 3, colour), origin: cloud.origin };
}

function labelLegend(names: string[], labels: ArrayLike<number>): Legend {
  const counts = new Array<number>(names.length).fill(0);
  let none = 0;
  for (let i = 0; i < labels.length; ++i)
    if (labels[i] >= 0) ++counts[labels[i]];
    else ++none;
  const items = names.map((name, i) => ({
    colour: css(palette(i)), label: name, note: `${share(counts[i], labels.length)}`,
  }));
  if (none > 0)
    items.push({ colour: css(palette(-1)), label: "no label", note: share(none, labels.length) });
  return { kind: "items", items };
}

function share(part: number, whole: number): string {
  return whole > 0 ? `${((100 * part) / whole).toFixed(part === whole || part === 0 ? 0 : 1)} %` : "";
}

function ramp(map: Ramp, low: string, high: string, label: string): Legend {
  return { kind: "ramp", ramp: map, low, high, label };
}

const choice = (key: string, label: string, options: string[]): Choice => ({ key, label, options });

function position(xyz: ArrayLike<number>, i: number): string {
  return [0, 1, 2].map((axis) => figure(xyz[3 * i + axis])).join(", ");
}

// -- Cloud ---------------------------------------------------------------------------------------

function cloudView(message: any, context: Context): View {
  const size = message.xyz.length / 3;
  const options = [];
  if (message.label.length === size && size > 0) options.push("label");
  if (message.rgb.length > 0) options.push("colour");
  if (message.normal.length > 0) options.push("normal");
  options.push("distance", "plain");
  const by = choice("cloud", "colour by", options);
  const chosen = context.choose(by);
  const view: View = { ...empty(), ...onCloud(message, () => kPlain), choices: [by] };
  if (chosen === "label") {
    view.colour = fill(size, (i) => palette(message.label[i]));
    view.legends = [labelLegend(message.label_names, message.label)];
  } else if (chosen === "colour") {
    view.colour = fill(size, (i) =>
      [0, 1, 2].map((axis) => 255 * message.rgb[3 * i + axis]) as Rgb);
  } else if (chosen === "normal") {
    view.colour = fill(size, (i) =>
      [0, 1, 2].map((axis) => 127.5 * (1 + message.normal[3 * i + axis])) as Rgb);
    view.legends = [{ kind: "items", items: [
      { colour: "rgb(255 127 127)", label: "x" }, { colour: "rgb(127 255 127)", label: "y" },
      { colour: "rgb(127 127 255)", label: "z" }] }];
  } else if (chosen === "distance") {
    const distance = Float32Array.from({ length: size }, (_, i) => Math.hypot(
      message.xyz[3 * i] - message.origin[0], message.xyz[3 * i + 1] - message.origin[1],
      message.xyz[3 * i + 2] - message.origin[2]));
    const [low, high] = [quantile(distance, 0.01), quantile(distance, 0.99)];
    view.colour = fill(size, (i) => sequential((distance[i] - low) / (high - low || 1)));
    view.legends = [ramp(sequential, figure(low), figure(high), "distance to the sensor")];
  }
  view.facts = [`${count(size)} points`];
  if (message.recipe !== "") view.facts.push(`scale ${figure(message.scale)}`);
  if (message.height > 1) view.facts.push(`${message.width} × ${message.height}`);
  view.facts.push(...message.notes);
  view.describe = (i) => ({
    text: `point ${count(i)} at ${position(message.xyz, i)}` +
      (message.label.length > 0 ? `, ${message.label_names[message.label[i]] ?? "no label"}` : ""),
  });
  return view;
}

// -- Supervoxels, Segments -----------------------------------------------------------------------

function supervoxelsView(message: any, context: Context): View {
  const cloud = cloudOf(context, message.of_point.length);
  const number = message.centroid.length / 3;
  const by = choice("supervoxels", "colour by", ["supervoxel", "size"]);
  const view: View = { ...empty(), choices: [by] };
  const sizes = message.point_count as ArrayLike<number>;
  view.facts = [`${count(number)} supervoxels`, `${count(message.adjacency.length / 2)} neighbours`,
    `seeds ${figure(message.seed_resolution)} apart`];
  if (cloud === null) return view;
  view.facts.unshift(`${count(message.of_point.length)} points`);
  if (context.choose(by) === "size") {
    const high = quantile(sizes, 0.98);
    Object.assign(view, onCloud(cloud, (i) => sequential(sizes[message.of_point[i]] / high)));
    view.legends = [ramp(sequential, "0", count(high), "points in the supervoxel")];
  } else {
    Object.assign(view, onCloud(cloud, (i) => scattered(message.of_point[i])));
  }
  view.describe = (i) => {
    const s = message.of_point[i];
    return { text: `point ${count(i)}, supervoxel ${s} of ${count(sizes[s])} points` };
  };
  return view;
}

// A segment pair's concavity.
function concavities(message: any): Map<string, number> {
  const result = new Map<string, number>();
  for (let p = 0; p < message.concavity.length; ++p)
    result.set(pairKey(message.adjacency[2 * p], message.adjacency[2 * p + 1]),
      message.concavity[p]);
  return result;
}
const pairKey = (a: number, b: number) => (a < b ? `${a},${b}` : `${b},${a}`);

function segmentsView(message: any, context: Context): View {
  const cloud = cloudOf(context, message.of_point.length);
  const supervoxels = context.find("Supervoxels")[0] ?? null;
  const by = choice("segments", "colour by", ["concavity", "segment"]);
  const view: View = { ...empty(), choices: [by] };
  view.facts = [`${count(message.count)} segments`,
    `${count(message.concavity.length)} neighbouring pairs`];
  if (cloud === null) return view;
  view.facts.unshift(`${count(message.of_point.length)} points`);
  const concavity = concavities(message);
  const ids = message.of_point as ArrayLike<number>;
  if (context.choose(by) === "segment" || supervoxels === null) {
    Object.assign(view, onCloud(cloud, (i) => palette(ids[i])));
  } else {
    const kBorder = 0.22; // of the seeds' distance: about two points on either side
    const other = otherGroupNearby(cloud.xyz, ids, kBorder * supervoxels.seed_resolution);
    Object.assign(view, onCloud(cloud, (i) => {
      const value = other[i] < 0 ? undefined : concavity.get(pairKey(ids[i], other[i]));
      return value === undefined ? muted(palette(ids[i])) : alarm(value);
    }));
    view.legends = [ramp(alarm, "convex", "concave", "borders of segments")];
  }
  view.describe = (i) => {
    const pairs = [...concavity].filter(([key]) => key.split(",").includes(String(ids[i])));
    const neighbours = pairs.map(([key, value]) =>
      `${key.split(",").find((s) => s !== String(ids[i]))} (${Math.round(100 * value)} % concave)`);
    return { text: `segment ${ids[i]}; next to ${neighbours.join(", ") || "none"}` };
  };
  return view;
}

// -- Descriptors, Encodings ----------------------------------------------------------------------

function basisColour(
  basis: Basis, values: ArrayLike<number>, row: number, dimension: number,
): Rgb {
  return [0, 1, 2].map((axis) =>
    127.5 + 60 * along(basis, axis, values, row, dimension)) as Rgb;
}

function clipped(colour: Rgb): Rgb {
  return colour.map((c) => Math.min(255, Math.max(0, c))) as Rgb;
}

function meanRow(values: ArrayLike<number>, rows: number, dimension: number): number[] {
  const mean = new Array<number>(dimension).fill(0);
  for (let r = 0; r < rows; ++r)
    for (let d = 0; d < dimension; ++d) mean[d] += values[r * dimension + d] / rows;
  return mean;
}

// The numbers of a list that came without zeros; `present` is told of in idl/sparse.hpp.
function unpacked(message: any): Float32Array {
  const { present, values } = message;
  const result = new Float32Array(present[0]);
  let at = 1;
  let from = 0;
  for (let block = 0; block < result.length; block += 1024) {
    const groups = present[at++];
    for (let group = 0; group < 32; ++group) {
      if (((groups >>> group) & 1) === 0) continue;
      const word = present[at++];
      for (let i = 0; i < 32; ++i)
        if (((word >>> i) & 1) === 1) result[block + 32 * group + i] = values[from++];
    }
  }
  return result;
}

function descriptorsView(message: any, context: Context): View {
  const names: string[] = message.channels.map((channel: any) => channel.name);
  const by = choice("channel", "channel", names);
  const view: View = { ...empty(), choices: [by] };
  const channel = message.channels[Math.max(0, names.indexOf(context.choose(by)))];
  const cloud = context.find("Cloud")[0] ?? null;
  if (channel === undefined) return view;
  const { dimension, keypoint } = channel;
  const rows = keypoint.length;
  const values = unpacked(channel);
  view.facts = [`${count(rows)} descriptors of ${dimension} numbers`];
  const indices = Array.from({ length: dimension }, (_, d) => d);
  const mean = meanRow(values, rows, dimension);
  view.charts = [{ title: "mean of all points", x: indices,
    series: [{ label: "mean", values: mean, colour: css(kPlain), filled: true }] }];
  if (cloud === null) return view;
  const rowOf = new Int32Array(cloud.xyz.length / 3).fill(-1);
  for (let r = 0; r < rows; ++r) rowOf[keypoint[r]] = r;
  const basis = context.keep(`axes ${channel.name}`, () =>
    principalAxes(values, rows, dimension, 3));
  Object.assign(view, onCloud(cloud, (i) =>
    rowOf[i] < 0 ? kMissing : clipped(basisColour(basis, values, rowOf[i], dimension))));
  view.facts.unshift(`${count(rowOf.length)} points`);
  view.facts.push("colours: the first three principal components");
  view.describe = (i) => {
    if (rowOf[i] < 0) return { text: `point ${count(i)} has no descriptor` };
    const own = Array.from(values.subarray(rowOf[i] * dimension, (rowOf[i] + 1) * dimension),
      Number);
    return { text: `point ${count(i)} at ${position(cloud.xyz, i)}`, chart: {
      title: `descriptor of point ${count(i)}`, x: indices,
      series: [
        { label: "mean", values: mean, colour: css(kMissing) },
        { label: "this point", values: own, colour: css(palette(0)), filled: true }],
    } };
  };
  return view;
}

function encodingsView(message: any, context: Context): View {
  const by = choice("encodings", "colour by", ["mean packet", "packets"]);
  const view: View = { ...empty(), choices: [by] };
  const packets = new Array<number>(message.segment_count).fill(0);
  for (const segment of message.segment) ++packets[segment];
  view.facts = [`${count(message.segment.length)} packets of ${count(message.dimension)} numbers`,
    `${count(message.segment_count)} segments`];
  view.charts = [{ title: "packets per segment", x: packets.map((_, s) => s),
    series: [{ label: "packets", values: packets, colour: css(kPlain), filled: true }] }];
  const segments = context.find("Segments")[0] ?? null;
  const cloud = segments === null ? null : cloudOf(context, segments.of_point.length);
  if (cloud === null) return view;
  const ids = segments.of_point;
  view.facts.unshift(`${count(ids.length)} points`);
  if (context.choose(by) === "packets") {
    const most = Math.max(1, ...packets);
    Object.assign(view, onCloud(cloud, (i) => sequential(packets[ids[i]] / most)));
    view.legends = [ramp(sequential, "0", count(most), "packets in the segment")];
  } else {
    const dimension = message.dimension;
    const values = unpacked(message);
    const means = new Float64Array(message.segment_count * dimension);
    for (let at = 0; at < values.length; ++at) {
      const s = message.segment[Math.floor(at / dimension)];
      means[s * dimension + at % dimension] += values[at] / packets[s];
    }
    const basis = context.keep(`axes ${dimension}`, () =>
      principalAxes(means, message.segment_count, dimension, 3));
    const colours = packets.map((number, s) =>
      number === 0 ? kMissing : clipped(basisColour(basis, means, s, dimension)));
    Object.assign(view, onCloud(cloud, (i) => colours[ids[i]] ?? kMissing));
    view.facts.push("colours: the first three principal components of the mean packets");
  }
  view.describe = (i) => ({ text: `segment ${ids[i]}, ${packets[ids[i]]} packets` });
  return view;
}

// -- Scores, Labelling ---------------------------------------------------------------------------

function scoresView(message: any, context: Context): View {
  const names: string[] = message.label_names;
  const labels = names.length;
  const by = choice("scores", "colour by", ["most likely label", ...names]);
  const view: View = { ...empty(), choices: [by] };
  const p = message.probability as ArrayLike<number>;
  const best = Array.from({ length: message.segment_count }, (_, s) => {
    let winner = 0;
    for (let l = 1; l < labels; ++l)
      if (p[s * labels + l] > p[s * labels + winner]) winner = l;
    return winner;
  });
  view.facts = [`${count(message.segment_count)} segments`];
  view.table = { columns: ["segment", ...names], rows: best.map((winner, s) => ({
    head: String(s),
    cells: names.map((_, l) => ({ text: p[s * labels + l].toFixed(2), share: p[s * labels + l],
      colour: l === winner ? palette(l) : kMissing })),
  })) };
  const segments = context.find("Segments")[0] ?? null;
  const cloud = segments === null ? null : cloudOf(context, segments.of_point.length);
  if (cloud === null) return view;
  const ids = segments.of_point as Int32Array;
  view.facts.unshift(`${count(ids.length)} points`);
  const chosen = names.indexOf(context.choose(by));
  if (chosen >= 0) {
    Object.assign(view, onCloud(cloud, (i) => sequential(p[ids[i] * labels + chosen] ?? 0)));
    view.legends = [ramp(sequential, "0", "1", `probability of ${names[chosen]}`)];
  } else {
    Object.assign(view, onCloud(cloud, (i) => palette(best[ids[i]] ?? -1)));
    view.legends = [labelLegend(names, Int32Array.from(ids, (s) => best[s] ?? -1))];
  }
  view.describe = (i) => ({
    text: `segment ${ids[i]}: ` + names.map((name, l) =>
      `${name} ${p[ids[i] * labels + l].toFixed(2)}`).join(", "),
  });
  return view;
}

// Labels that are places in `from` as places in `to`; -1: not there.
function renumbered(labels: ArrayLike<number>, from: string[], to: string[]): Int32Array {
  const place = from.map((name) => to.indexOf(name));
  const result = new Int32Array(labels.length);
  for (let i = 0; i < labels.length; ++i) result[i] = labels[i] < 0 ? -1 : place[labels[i]];
  return result;
}

function labellingView(message: any, context: Context): View {
  const names: string[] = message.label_names;
  const labels = message.point_label as Int32Array;
  const confidence = message.point_confidence as ArrayLike<number>;
  const cloud = cloudOf(context, labels.length);
  const truth = cloud === null || cloud.label.length === 0 ? null
    : renumbered(cloud.label, cloud.label_names, names);
  const by = choice("labelling", "colour by",
    truth === null ? ["label", "confidence"] : ["label", "confidence", "true label", "errors"]);
  const view: View = { ...empty(), choices: [by] };
  view.facts = [`${count(labels.length)} points`];
  if (truth !== null) {
    let [right, known] = [0, 0];
    for (let i = 0; i < truth.length; ++i) {
      if (truth[i] >= 0) ++known;
      if (truth[i] >= 0 && truth[i] === labels[i]) ++right;
    }
    if (known > 0) view.facts.push(`accuracy ${share(right, known)} (per dense point)`);
  }
  if (message.segment_label.length > 0)
    view.facts.push(
      message.proven_optimal ? "proven optimal" : `gap ${figure(message.gap)}`,
      `energy ${figure(message.energy)}`, `${message.violations} violations`);
  if (cloud === null) {
    view.legends = [labelLegend(names, labels)];
    return view;
  }
  const chosen = context.choose(by);
  if (chosen === "confidence") {
    Object.assign(view, onCloud(cloud, (i) => sequential(confidence[i])));
    view.legends = [ramp(sequential, "0", "1", "confidence")];
  } else if (chosen === "true label" && truth !== null) {
    Object.assign(view, onCloud(cloud, (i) => palette(truth[i])));
    view.legends = [labelLegend(names, truth)];
  } else if (chosen === "errors" && truth !== null) {
    const wrong: Rgb = [200, 30, 45];
    Object.assign(view, onCloud(cloud, (i) => truth[i] < 0 ? kMissing
      : truth[i] === labels[i] ? muted(palette(labels[i])) : wrong));
    view.legends = [{ kind: "items", items: [{ colour: css(wrong), label: "wrong" }] }];
  } else {
    Object.assign(view, onCloud(cloud, (i) => palette(labels[i])));
    view.legends = [labelLegend(names, labels)];
  }
  view.describe = (i) => ({
    text: `point ${count(i)}: ${names[labels[i]] ?? "no label"}, confidence ` +
      `${figure(confidence[i])}` +
      (truth === null ? "" : `, truly ${names[truth[i]] ?? "unknown"}`),
  });
  return view;
}

// -- Spectrum ------------------------------------------------------------------------------------

function spectrumView(message: any, context: Context): View {
  const modes = message.eigenvalue.length;
  const by = choice("mode", "eigenfunction",
    Array.from({ length: modes }, (_, e) => String(e + 1)));
  const view: View = { ...empty(), choices: [by] };
  const mode = Math.max(0, Number(context.choose(by)) - 1);
  const samples = message.sample_index.length;
  view.facts = [`${count(samples)} samples`, `${modes} eigenpairs`,
    `λ${mode + 1} = ${figure(message.eigenvalue[mode])}`];
  view.charts = pairCharts(message, context);
  view.chartTitle = "commute-time distances of parts: this frame, and the model's mixtures";
  if (view.charts.length === 0) {
    view.chartTitle = undefined;
    view.charts = [{ title: "eigenvalues", x: Array.from({ length: modes }, (_, e) => e + 1),
      series: [{ label: "λ", values: Array.from(message.eigenvalue, Number), colour: css(kPlain),
        filled: true }] }];
  }
  const cloud = cloudOf(context, message.nearest_sample.length);
  if (cloud === null) return view;
  const value = (i: number) =>
    message.eigenfunction[message.nearest_sample[i] * modes + mode] as number;
  const high = quantile(Float32Array.from({ length: samples }, (_, s) =>
    Math.abs(message.eigenfunction[s * modes + mode])), 0.98) || 1;
  Object.assign(view, onCloud(cloud, (i) => diverging(0.5 + (0.5 * value(i)) / high)));
  view.facts.unshift(`${count(cloud.xyz.length / 3)} points`);
  view.legends = [ramp(diverging, figure(-high), figure(high), `eigenfunction ${mode + 1}`)];
  view.describe = (i) => ({
    text: `sample ${message.nearest_sample[i]}, value ${figure(value(i))}, ` +
      `piece ${message.piece[message.nearest_sample[i]]}` });
  return view;
}

// Fig. 3 of the paper: for each pair of parts the distances in this frame, by the labels that it
// was given, beside the mixture that the model learned.
function pairCharts(message: any, context: Context): Chart[] {
  const labelling = context.later("Labelling");
  const model = context.latched("RelationModel");
  if (labelling === null || model === null || model.offset.length === 0) return [];
  const names: string[] = model.label_names;
  const label = Array.from(message.sample_dense as Int32Array, (dense) =>
    names.indexOf(labelling.label_names[labelling.point_label[dense]]));
  const modes = message.eigenvalue.length;
  const embedding = Float64Array.from(message.eigenfunction as Float32Array, (v, i) =>
    v / Math.sqrt(message.eigenvalue[i % modes]));
  const distances: number[][] = names.flatMap((_, a) => names.slice(0, a + 1).map(() => []));
  const pairIndex = (a: number, b: number) =>
    a < b ? (b * (b + 1)) / 2 + a : (a * (a + 1)) / 2 + b;
  for (let i = 0; i < label.length; ++i)
    for (let j = i + 1; j < label.length; ++j) {
      if (label[i] < 0 || label[j] < 0) continue;
      let square = 0;
      for (let e = 0; e < modes; ++e)
        square += (embedding[i * modes + e] - embedding[j * modes + e]) ** 2;
      distances[pairIndex(label[i], label[j])].push(Math.sqrt(square));
    }
  let end = 0;
  for (const list of distances) end = Math.max(end, quantile(list, 0.999));
  for (let k = 0; k < model.mean.length; ++k)
    end = Math.max(end, model.mean[k] + 2 * model.sigma[k]);
  const kBins = 60;
  const x = Array.from({ length: kBins }, (_, b) => ((b + 0.5) / kBins) * end);
  const charts: Chart[] = [];
  for (let b = 0; b < names.length; ++b)
    for (let a = 0; a <= b; ++a) {
      const pair = pairIndex(a, b);
      const colour = a === b ? css(palette(a)) : "--edge";
      charts.push({ title: a === b ? names[a] : `${names[a]} – ${names[b]}`, x, series: [
        { label: "this frame", values: histogram(distances[pair], kBins, end), filled: true,
          colour },
        { label: "model", colour: "--text", values: x.map((d) => mixtureDensity(d,
          model.weight, model.mean, model.sigma, model.offset[pair], model.offset[pair + 1])) }],
      });
    }
  return charts;
}

// -- models and the rest -------------------------------------------------------------------------

function relationsView(message: any): View {
  const names: string[] = message.label_names;
  const view = empty();
  view.facts = [`${names.length} labels`, names.join(", ")];
  view.table = { columns: ["neighbours", ...names], rows: names.map((name, a) => ({ head: name,
    cells: names.map((_, b) => ({
      text: message.neighbours[a * names.length + b] ? "yes" : "no" })) })) };
  if (message.offset.length === 0) return view;
  let end = 0;
  for (let k = 0; k < message.mean.length; ++k)
    end = Math.max(end, message.mean[k] + 3 * message.sigma[k]);
  const x = Array.from({ length: 100 }, (_, i) => ((i + 0.5) / 100) * end);
  view.chartTitle = "commute-time distances of parts, as the model learned them";
  for (let b = 0; b < names.length; ++b)
    for (let a = 0; a <= b; ++a) {
      const pair = (b * (b + 1)) / 2 + a;
      view.charts.push({ title: a === b ? names[a] : `${names[a]} – ${names[b]}`, x, series: [{
        label: "model", filled: true, colour: a === b ? css(palette(a)) : "--edge",
        values: x.map((d) => mixtureDensity(d, message.weight, message.mean, message.sigma,
          message.offset[pair], message.offset[pair + 1])) }] });
    }
  return view;
}

function appearanceView(message: any): View {
  const view = empty();
  view.facts = [`model ${message.id.toString(16)}`, `${message.kernel} classifier over ` +
    `${count(message.classifier_dimension)} numbers`];
  view.legends = [{ kind: "items", items: message.label_names.map((label: string, i: number) => ({
    colour: css(palette(i)), label, note: share(message.label_share[i], 1) })) }];
  view.table = { columns: ["channel", "numbers", "projected to", "Gaussians"],
    rows: message.channels.map((channel: any) => ({ head: channel.name, cells: [
      { text: count(channel.dimension) },
      { text: channel.projection_output > 0 ? count(channel.projection_output) : "–" },
      { text: count(channel.mixture_components) }] })) };
  return view;
}

const kViews: Record<string, (message: any, context: Context) => View> = {
  Cloud: cloudView,
  Supervoxels: supervoxelsView,
  Segments: segmentsView,
  Descriptors: descriptorsView,
  Encodings: encodingsView,
  Scores: scoresView,
  Spectrum: spectrumView,
  Labelling: labellingView,
  AppearanceModel: appearanceView,
  RelationModel: relationsView,
};

export function canShow(type: string): boolean {
  return type in kViews;
}

export function makeView(type: string, message: any, context: Context): View {
  return kViews[type](message, context);
}

// Types of messages that are needed beside one of `type`, from before it; those it can do without
// are among them.
export function needs(type: string): string[] {
  switch (type) {
    case "Segments":
      return ["Cloud", "Supervoxels"];
    case "Encodings":
    case "Scores":
    case "Labelling":
      return ["Cloud", "Segments"];
    case "Supervoxels":
    case "Descriptors":
    case "Spectrum":
      return ["Cloud"];
    default:
      return [];
  }
}

// Types from elsewhere in the graph.
export function needsLater(type: string): string[] {
  return type === "Spectrum" ? ["Labelling", "RelationModel"] : [];
}
