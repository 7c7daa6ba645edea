// Small helpers for building the page. No HTML is ever parsed: texts come from elsewhere.

type Child = Node | string | null | undefined;
type Props = Record<string, unknown>;

export function h<K extends keyof HTMLElementTagNameMap>(
  tag: K, props: Props = {}, ...children: Child[]
): HTMLElementTagNameMap[K] {
  return fill(document.createElement(tag), props, children);
}

export function svg<K extends keyof SVGElementTagNameMap>(
  tag: K, props: Props = {}, ...children: Child[]
): SVGElementTagNameMap[K] {
  return fill(document.createElementNS("http://www.w3.org/2000/svg", tag), props, children);
}

function fill<E extends Element>(element: E, props: Props, children: Child[]): E {
  for (const [key, value] of Object.entries(props)) {
    if (value === undefined || value === false) continue;
    if (key.startsWith("on")) element.addEventListener(key.slice(2), value as EventListener);
    else element.setAttribute(key, value === true ? "" : String(value));
  }
  element.append(...children.filter((child) => child != null) as (Node | string)[]);
  return element;
}

// Sets a text only if it changed, so that selections and screen readers are left alone.
export function setText(element: Element, text: string): void {
  if (element.textContent !== text) element.textContent = text;
}

export function replace(element: Element, ...children: Child[]): void {
  element.replaceChildren(...children.filter((child) => child != null) as (Node | string)[]);
}

export function count(value: number): string {
  return value.toLocaleString("en", { maximumFractionDigits: 0 });
}

export function bytes(value: number): string {
  if (value < 1e3) return `${Math.round(value)} B`;
  if (value < 1e6) return `${(value / 1e3).toPrecision(3)} kB`;
  if (value < 1e9) return `${(value / 1e6).toPrecision(3)} MB`;
  return `${(value / 1e9).toPrecision(3)} GB`;
}

export function rate(value: number): string {
  if (value <= 0) return "–";
  return `${value < 10 ? value.toFixed(1) : Math.round(value)}/s`;
}

export function milliseconds(value: number): string {
  if (value < 10) return `${value.toFixed(1)} ms`;
  return value < 1000 ? `${Math.round(value)} ms` : `${(value / 1000).toPrecision(2)} s`;
}

export function figure(value: number): string {
  if (!Number.isFinite(value)) return "–";
  return Math.abs(value) >= 1000 ? count(value) : String(Number(value.toPrecision(3)));
}
