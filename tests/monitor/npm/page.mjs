// Opens the monitor's page in a browser and goes through topics. Prints as JSON what each pane said
// and how much of its canvas is drawn on, and leaves a picture of each.
//   node page.mjs BROWSER URL FOLDER THEME TOPIC...
import { open } from "./browser.mjs";

const [executable, url, folder, theme, ...topics] = process.argv.slice(2);
const { browser, page, errors } = await open(executable, theme, url);
const seen = { errors, topics: {} };

// Pictures are looked at in a page of their own: the monitor's may not load them.
const tool = await browser.newPage();
await page.bringToFront();

// The share of the canvas, a part of a picture of the page, that is not background.
async function drawn(pane, png) {
  const { x, y, width, height } = await pane.locator(".canvas").boundingBox();
  const box = [x, y, width, height].map(Math.floor);
  return tool.evaluate(async ([base64, part]) => {
    const picture = await (await fetch(`data:image/png;base64,${base64}`)).blob();
    const bitmap = await createImageBitmap(picture, ...part);
    const canvas = new OffscreenCanvas(bitmap.width, bitmap.height);
    const context = canvas.getContext("2d");
    context.drawImage(bitmap, 0, 0);
    const { data } = context.getImageData(0, 0, bitmap.width, bitmap.height);
    const corner = data.slice(data.length - 4);
    let different = 0;
    for (let i = 0; i < data.length; i += 4)
      if ([0, 1, 2].some((c) => Math.abs(data[i + c] - corner[c]) > 24)) ++different;
    return different / (bitmap.width * bitmap.height);
  }, [png.toString("base64"), box]);
}

for (const topic of topics) {
  const pane = page.locator(".pane.active");
  await pane.locator("> header > select").selectOption(topic);
  await page.locator("h1").click(); // out of the list: keys are keys again
  const type = await pane.locator("> header > select > option:checked").textContent();
  await page.waitForFunction((wanted) => {
    const active = document.querySelector(".pane.active");
    return active.dataset.type === wanted && Number(active.dataset.points) > 0;
  }, type.split(" · ")[1]);
  // A labelling comes after its frame's spectrum, and with it the distances of parts.
  if (topic.endsWith("/spectrum")) await pane.locator(".caption").waitFor();
  const png = await page.screenshot({ path: `${folder}/${topic.replaceAll("/", "-")}-${theme}.png` });
  seen.topics[topic] = {
    points: Number(await pane.getAttribute("data-points")),
    facts: await pane.locator(".facts span").allTextContents(),
    legend: await pane.locator(".legend").innerText(),
    charts: await pane.locator(".chart").count(),
    rows: await pane.locator(".table tbody tr").count(),
    drawn: await drawn(pane, png),
  };
}
seen.theme = await page.evaluate(() => document.documentElement.dataset.theme);
seen.pill = await page.locator(".pill").textContent();
seen.account = await page.locator(".account").textContent();
seen.stages = await page.locator(".graph .stage").count();
seen.wires = await page.locator(".graph .wire").count();
seen.rate = await page.locator(".graph .rate").allTextContents();

// The keyboard: hold the frame, go to the one beside it and back, ask for the keys, close them.
const frame = () => page.locator(".frame-name").textContent();
const press = async (key) => {
  const before = await frame();
  await page.keyboard.press(key);
  await page.waitForFunction((old) =>
    document.querySelector(".frame-name").textContent !== old, before);
};
if (await page.locator("footer input").isEnabled()) {
  // Of a file it is held already; what plays would go on between a key and a look.
  if (await page.locator('.follow[aria-pressed="true"]').count() > 0) await press(" ");
  const isFirst = (await page.locator("footer input").inputValue()) === "0";
  seen.held = [await frame()];
  for (const key of isFirst ? ["ArrowRight", "ArrowLeft"] : ["ArrowLeft", "ArrowRight"]) {
    await press(key);
    seen.held.push(await frame());
  }
}
await page.keyboard.press("?");
await page.waitForSelector("dialog.help[open]");
seen.help = await page.locator("dialog.help").innerText();
await page.keyboard.press("Escape");
await page.keyboard.press("t");
seen.otherTheme = await page.evaluate(() => document.documentElement.dataset.theme);

console.log(JSON.stringify(seen));
await browser.close();
