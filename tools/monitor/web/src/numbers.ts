// The little mathematics that drawing needs.

export interface Basis {
  mean: Float64Array;
  axes: Float64Array[]; // orthonormal
  spread: number[]; // standard deviation along each
}

// The first `count` principal axes of `rows` x `dimension` values, by power iteration.
export function principalAxes(
  values: ArrayLike<number>, rows: number, dimension: number, count: number,
): Basis {
  const mean = new Float64Array(dimension);
  for (let r = 0; r < rows; ++r)
    for (let d = 0; d < dimension; ++d) mean[d] += values[r * dimension + d] / rows;
  const axes: Float64Array[] = [];
  const spread: number[] = [];
  for (let a = 0; a < Math.min(count, dimension); ++a) {
    let axis = Float64Array.from({ length: dimension }, (_, d) => Math.sin(1 + d * (a + 1.3)));
    let variance = 0;
    for (let iteration = 0; iteration < 12; ++iteration) {
      for (const other of axes) subtract(axis, other, dot(axis, other));
      scale(axis, 1 / (Math.sqrt(dot(axis, axis)) || 1));
      const next = new Float64Array(dimension);
      variance = 0;
      for (let r = 0; r < rows; ++r) {
        let along = 0;
        for (let d = 0; d < dimension; ++d)
          along += (values[r * dimension + d] - mean[d]) * axis[d];
        variance += (along * along) / Math.max(1, rows);
        for (let d = 0; d < dimension; ++d)
          next[d] += along * (values[r * dimension + d] - mean[d]);
      }
      if (iteration < 11) axis = next;
    }
    axes.push(axis);
    spread.push(Math.sqrt(variance));
  }
  return { mean, axes, spread };
}

// Coordinate of a row along an axis, in standard deviations.
export function along(
  basis: Basis, axis: number, values: ArrayLike<number>, row: number, dimension: number,
): number {
  if (axis >= basis.axes.length) return 0;
  let sum = 0;
  for (let d = 0; d < dimension; ++d)
    sum += (values[row * dimension + d] - basis.mean[d]) * basis.axes[axis][d];
  return sum / (basis.spread[axis] || 1);
}

function dot(a: Float64Array, b: Float64Array): number {
  let sum = 0;
  for (let i = 0; i < a.length; ++i) sum += a[i] * b[i];
  return sum;
}
function subtract(a: Float64Array, b: Float64Array, factor: number): void {
  for (let i = 0; i < a.length; ++i) a[i] -= factor * b[i];
}
function scale(a: Float64Array, factor: number): void {
  for (let i = 0; i < a.length; ++i) a[i] *= factor;
}

// Densities over `bins` equal bins of 0 .. end.
export function histogram(values: number[], bins: number, end: number): number[] {
  const result = new Array<number>(bins).fill(0);
  const share = bins / end / Math.max(1, values.length);
  for (const value of values) {
    const bin = Math.min(bins - 1, Math.floor((value / end) * bins));
    if (bin >= 0) result[bin] += share;
  }
  return result;
}

// The value below which `share` of the finite values lie; of many values an even selection is asked.
export function quantile(values: ArrayLike<number>, share: number): number {
  const kEnough = 8000;
  const step = Math.max(1, Math.floor(values.length / kEnough));
  const some = new Float64Array(Math.ceil(values.length / step));
  for (let i = 0; i < some.length; ++i) some[i] = values[i * step];
  const sorted = some.filter(Number.isFinite).sort();
  if (sorted.length === 0) return 0;
  return sorted[Math.min(sorted.length - 1, Math.floor(share * sorted.length))];
}

export function mixtureDensity(
  x: number, weight: ArrayLike<number>, mean: ArrayLike<number>, sigma: ArrayLike<number>,
  first: number, last: number,
): number {
  let sum = 0;
  for (let k = first; k < last; ++k) {
    const z = (x - mean[k]) / sigma[k];
    sum += (weight[k] * Math.exp(-0.5 * z * z)) / (sigma[k] * Math.sqrt(2 * Math.PI));
  }
  return sum;
}

// For each point the group of the nearest point of another group within `radius`; -1: none. Points
// without coordinates have none.
export function otherGroupNearby(
  xyz: ArrayLike<number>, group: ArrayLike<number>, radius: number,
): Int32Array {
  const count = group.length;
  const cells = new Map<number, number[]>();
  const place = (v: number) => Math.floor(v / radius);
  const key = (x: number, y: number, z: number) =>
    (Math.imul(x, 73856093) ^ Math.imul(y, 19349663) ^ Math.imul(z, 83492791)) >>> 0;
  for (let i = 0; i < count; ++i) {
    if (!Number.isFinite(xyz[3 * i])) continue;
    const k = key(place(xyz[3 * i]), place(xyz[3 * i + 1]), place(xyz[3 * i + 2]));
    const cell = cells.get(k);
    if (cell === undefined) cells.set(k, [i]);
    else cell.push(i);
  }
  const result = new Int32Array(count).fill(-1);
  for (let i = 0; i < count; ++i) {
    const [x, y, z] = [xyz[3 * i], xyz[3 * i + 1], xyz[3 * i + 2]];
    if (!Number.isFinite(x)) continue;
    let nearest = radius * radius;
    for (let dx = -1; dx <= 1; ++dx)
      for (let dy = -1; dy <= 1; ++dy)
        for (let dz = -1; dz <= 1; ++dz)
          for (const j of cells.get(key(place(x) + dx, place(y) + dy, place(z) + dz)) ?? []) {
            if (group[j] === group[i]) continue;
            const distance = (xyz[3 * j] - x) ** 2 + (xyz[3 * j + 1] - y) ** 2 +
              (xyz[3 * j + 2] - z) ** 2;
            if (distance >= nearest) continue;
            nearest = distance;
            result[i] = group[j];
          }
  }
  return result;
}
