// Colours of numbers. Colours are bytes, three per point, shown as they are.

// The palette of the pictures that `cosegraph segment` draws (components/sink): told apart by
// colour-blind eyes.
const kPalette = [
  0x2579dd, 0xbf7600, 0xf42d92, 0x58c9fd, 0x0b4b3b, 0xe6e639, 0x3e00bb, 0x5efdaf, 0x930000,
  0xb7d9e3, 0x81ed73, 0xa5935a,
];
const kGrey: Rgb = [150, 150, 155];

export type Rgb = [number, number, number];

function mixed(colour: Rgb, target: number, amount: number): Rgb {
  return colour.map((c) => c + amount * (target - c)) as Rgb;
}

const kKnown: Rgb[] = [];

export function palette(index: number): Rgb {
  return index < 0 ? kGrey : (kKnown[index] ??= paletteColour(index));
}

function paletteColour(index: number): Rgb {
  const code = kPalette[index % kPalette.length];
  const colour: Rgb = [code >> 16, (code >> 8) & 255, code & 255];
  const round = Math.floor(index / kPalette.length) % 3;
  return round === 1 ? mixed(colour, 0, 0.4) : round === 2 ? mixed(colour, 255, 0.5) : colour;
}

export function css([r, g, b]: Rgb): string {
  return `rgb(${Math.round(r)} ${Math.round(g)} ${Math.round(b)})`;
}

// Between fixed colours; t is cut to 0 .. 1.
export type Ramp = (t: number) => Rgb;

function ramp(...codes: number[]): Ramp {
  const stops = codes.map((code): Rgb => [code >> 16, (code >> 8) & 255, code & 255]);
  return (t) => {
    const at = Math.min(1, Math.max(0, Number.isFinite(t) ? t : 0)) * (stops.length - 1);
    const low = Math.min(Math.floor(at), stops.length - 2);
    const share = at - low;
    return stops[low].map((c, i) => c + share * (stops[low + 1][i] - c)) as Rgb;
  };
}

// From dark to bright, in equal steps to the eye.
export const sequential = ramp(0x440154, 0x414487, 0x2a788e, 0x22a884, 0x7ad151, 0xfde725);
// Around a middle.
export const diverging = ramp(0x2166ac, 0x67a9cf, 0xd1d5da, 0xef8a62, 0xb2182b);
// From unremarkable to alarming.
export const alarm = ramp(0xf2efe6, 0xfdbb84, 0xe34a33, 0x7f0000);

export function fill(count: number, colour: (i: number) => Rgb): Uint8Array {
  const result = new Uint8Array(3 * count);
  for (let i = 0; i < count; ++i) {
    const c = colour(i);
    result[3 * i] = c[0];
    result[3 * i + 1] = c[1];
    result[3 * i + 2] = c[2];
  }
  return result;
}

// Many small groups next to each other: hues far apart for numbers that are close.
export function scattered(index: number): Rgb {
  if (index < 0) return kGrey;
  const hue = (index * 0.61803398875) % 1;
  const light = 0.5 + 0.14 * ((index * 0.38196601) % 1);
  return fromHsl(hue, 0.62, light);
}

function fromHsl(h: number, s: number, l: number): Rgb {
  const channel = (n: number) => {
    const k = (n + 12 * h) % 12;
    return 255 * (l - s * Math.min(l, 1 - l) * Math.max(-1, Math.min(k - 3, 9 - k, 1)));
  };
  return [channel(0), channel(8), channel(4)];
}

// Lines on the page's background, in either theme.
export function lineColour(index: number, dark: boolean): string {
  const hue = Math.round((index * 360 * 0.61803398875 + 250) % 360);
  return `oklch(${dark ? 0.76 : 0.55} 0.14 ${hue})`;
}

export function muted(colour: Rgb): Rgb {
  return mixed(colour, 165, 0.45);
}
