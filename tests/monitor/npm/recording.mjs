// Goes through a recording in the monitor's page, as a person does with the slider and the keyboard.
// Prints what was shown at each place as JSON, and leaves a picture of the last.
//   node recording.mjs BROWSER URL FOLDER THEME TOPIC
import { open } from "./browser.mjs";

const [executable, url, folder, theme, topic] = process.argv.slice(2);
const { browser, page, errors } = await open(executable, theme, url);
const seen = { errors, places: {} };

const slider = page.locator("footer input");
const pane = page.locator(".pane.active");
const name = () => page.locator(".frame-name").textContent();
// Where the slider is, when what the pane shows there has come.
const place = async () => {
  await page.waitForFunction(() => {
    const active = document.querySelector(".pane.active");
    return document.querySelector(".frame-name").textContent
      .startsWith(`${active.dataset.frame} · `) && Number(active.dataset.points) > 0;
  });
  return { number: Number(await slider.inputValue()), name: await name() };
};
const go = async (move) => {
  const before = await name();
  await move();
  await page.waitForFunction((old) =>
    document.querySelector(".frame-name").textContent !== old, before);
  return place();
};
const press = (key) => go(() => page.keyboard.press(key));

await page.waitForFunction(() => !document.querySelector("footer input").disabled);
await pane.locator("> header > select").selectOption(topic);
await page.locator("h1").click(); // out of the list: keys are keys again
seen.places.first = await place();
seen.places.last = await press("End");
seen.places.before = await press("ArrowLeft");
seen.places.middle = await go(() => slider.fill(String(Math.floor(seen.places.last.number / 2))));
seen.places.again = await press("Home");

const plays = (is) => page.locator(`.follow[aria-pressed="${is}"]`).waitFor();
await page.keyboard.press(" ");
await plays(true);
await page.waitForFunction(() => Number(document.querySelector("footer input").value) >= 3);
await page.keyboard.press(" ");
await plays(false);
seen.places.played = await place();
await page.screenshot({ path: `${folder}/recording-${theme}.png` });
console.log(JSON.stringify(seen));
await browser.close();
