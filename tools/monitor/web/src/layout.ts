// Lays a graph out from left to right: layers by longest path, few crossings by barycentres, long
// edges bent around what lies between (after Sugiyama, Tagawa, Toda, 1981).

export interface Box {
  name: string;
  height: number;
}

export interface Wire {
  from: string;
  to: string;
  out: number; // where it leaves and enters, below the boxes' upper ends
  into: number;
}

export interface Placed {
  width: number;
  height: number;
  boxes: Map<string, { x: number; y: number }>;
  paths: string[]; // of the wires, for SVG
}

interface Item {
  name: string; // of a box, or nothing
  layer: number;
  height: number;
  y: number;
  before: { item: Item; weight: number; offset: number }[];
  after: { item: Item; weight: number; offset: number }[];
}

const kGap = 14; // between boxes of a layer
const kBend = 4; // height of an edge that passes

export function layOut(boxes: Box[], wires: Wire[], boxWidth: number, step: number): Placed {
  const layerOf = layers(boxes, wires);
  const items = new Map<string, Item>();
  for (const box of boxes)
    items.set(box.name, { name: box.name, layer: layerOf.get(box.name)!, height: box.height, y: 0,
      before: [], after: [] });
  const bends: Item[][] = wires.map((wire) => thread(wire, items));
  const all = [...items.values(), ...bends.flat()];
  const columns: Item[][] = [];
  for (const item of all) (columns[item.layer] ??= []).push(item);
  order(columns);
  place(columns);
  const top = Math.min(...all.map((item) => item.y));
  for (const item of all) item.y -= top;
  return {
    width: (columns.length - 1) * step + boxWidth,
    height: Math.max(0, ...all.map((item) => item.y + item.height)),
    boxes: new Map([...items].map(([name, item]) => [name, { x: item.layer * step, y: item.y }])),
    paths: wires.map((wire, w) => path(wire, items, bends[w], boxWidth, step)),
  };
}

function layers(boxes: Box[], wires: Wire[]): Map<string, number> {
  const layer = new Map(boxes.map((box) => [box.name, 0]));
  for (let round = 0; round < boxes.length; ++round)
    for (const { from, to } of wires)
      if (layer.get(to)! <= layer.get(from)!) layer.set(to, layer.get(from)! + 1);
  // As far right as what it feeds allows: short edges. What is fed stays.
  for (let round = 0; round < boxes.length; ++round)
    for (const { name } of boxes) {
      if (wires.some((wire) => wire.to === name)) continue;
      const next = wires.filter((wire) => wire.from === name).map((wire) => layer.get(wire.to)!);
      if (next.length > 0) layer.set(name, Math.min(...next) - 1);
    }
  return layer;
}

// Bends in the layers that a wire passes, tied to each other and to its ends.
function thread(wire: Wire, items: Map<string, Item>): Item[] {
  const from = items.get(wire.from)!;
  const to = items.get(wire.to)!;
  const bends: Item[] = [];
  let last = from;
  let offset = wire.out;
  const tie = (next: Item, into: number, weight: number) => {
    last.after.push({ item: next, weight, offset: into - offset });
    next.before.push({ item: last, weight, offset: offset - into });
    last = next;
    offset = into;
  };
  for (let layer = from.layer + 1; layer < to.layer; ++layer) {
    const bend: Item = { name: "", layer, height: kBend, y: 0, before: [], after: [] };
    bends.push(bend);
    tie(bend, kBend / 2, layer === from.layer + 1 ? 1 : 8);
  }
  tie(to, wire.into, 1);
  return bends;
}

function order(columns: Item[][]): void {
  const index = new Map<Item, number>();
  const number = (column: Item[]) => column.forEach((item, i) =>
    index.set(item, (i + 0.5) / column.length));
  columns.forEach(number);
  const sort = (column: Item[], ties: "before" | "after") => {
    const value = (item: Item) => {
      const list = item[ties];
      return list.length === 0 ? index.get(item)!
        : list.reduce((sum, tie) => sum + index.get(tie.item)!, 0) / list.length;
    };
    const values = new Map(column.map((item) => [item, value(item)]));
    column.sort((a, b) => values.get(a)! - values.get(b)!);
    number(column);
  };
  for (let sweep = 0; sweep < 8; ++sweep) {
    for (let c = 1; c < columns.length; ++c) sort(columns[c], "before");
    for (let c = columns.length - 2; c >= 0; --c) sort(columns[c], "after");
  }
}

// Each to the middle of where its neighbours want it, as far as the order allows.
function place(columns: Item[][]): void {
  for (const column of columns) {
    let y = 0;
    for (const item of column) {
      item.y = y;
      y += item.height + kGap;
    }
  }
  for (let sweep = 0; sweep < 60; ++sweep) {
    const forward = sweep % 2 === 0;
    for (const column of forward ? columns : [...columns].reverse()) {
      const wish = new Map<Item, number>();
      for (const item of column) {
        const ties = [...item.before, ...item.after];
        const weight = ties.reduce((sum, tie) => sum + tie.weight, 0);
        wish.set(item, weight === 0 ? item.y : ties.reduce((sum, tie) =>
          sum + tie.weight * (tie.item.y + tie.offset), 0) / weight);
      }
      settle(column, wish);
    }
  }
}

// Fulfils wishes without overlaps: from above and from below, and the middle of both.
function settle(column: Item[], wish: Map<Item, number>): void {
  const down = column.map((item) => wish.get(item)!);
  for (let i = 1; i < column.length; ++i)
    down[i] = Math.max(down[i], down[i - 1] + column[i - 1].height + kGap);
  const up = column.map((item) => wish.get(item)!);
  for (let i = column.length - 2; i >= 0; --i)
    up[i] = Math.min(up[i], up[i + 1] - column[i].height - kGap);
  column.forEach((item, i) => (item.y = 0.5 * (down[i] + up[i])));
}

function path(
  wire: Wire, items: Map<string, Item>, bends: Item[], boxWidth: number, step: number,
): string {
  const from = items.get(wire.from)!;
  const to = items.get(wire.to)!;
  let x = from.layer * step + boxWidth;
  let y = from.y + wire.out;
  let text = `M${x} ${y}`;
  const curve = (nextX: number, nextY: number) => {
    const pull = 0.5 * (nextX - x);
    text += `C${x + pull} ${y} ${nextX - pull} ${nextY} ${nextX} ${nextY}`;
    [x, y] = [nextX, nextY];
  };
  for (const bend of bends) {
    const at = bend.y + bend.height / 2;
    curve(bend.layer * step, at);
    text += `H${bend.layer * step + boxWidth}`;
    x = bend.layer * step + boxWidth;
  }
  curve(to.layer * step, to.y + wire.into);
  return text;
}
