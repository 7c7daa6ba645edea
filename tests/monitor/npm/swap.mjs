// Swaps a stage in the monitor's page, as a person does with the keyboard. Prints what the page said
// as JSON, and leaves a picture of the report.
//   node swap.mjs BROWSER URL FOLDER THEME STAGE PARAMETER VALUE BAD_VALUE
import { open } from "./browser.mjs";

const [executable, url, folder, theme, stage, parameter, value, bad] = process.argv.slice(2);
const { browser, page, errors } = await open(executable, theme, url);
const seen = { errors };

const dialog = page.locator("dialog.stage-dialog");
const result = dialog.locator(".result");
const outcome = async (button) => {
  await dialog.getByRole("button", { name: button, exact: true }).click();
  // The one of before goes at once.
  await page.waitForFunction(() =>
    ["good", "bad"].includes(document.querySelector(".result").dataset.outcome));
  return { kind: await result.getAttribute("data-outcome"), text: await result.innerText() };
};

await page.waitForFunction(() => / labelled/.test(document.querySelector(".account").textContent));
await page.locator(`.graph .head[aria-label="stage ${stage}"]`).focus();
await page.keyboard.press("Enter");
await dialog.waitFor();
seen.processes = await dialog.locator("tbody tr").allTextContents();
const field = dialog.locator(".params label").filter({ hasText: parameter }).first()
  .locator("input, select");
seen.before = await field.inputValue();
await field.fill(bad);
seen.bad = await outcome("Swap");
await field.fill(value);
seen.trial = await outcome("Try");
seen.swap = await outcome("Swap");
await page.waitForFunction(() =>
  /generation [1-9]/.test(document.querySelector(".stage-dialog tbody tr").textContent));
seen.after = await dialog.locator("tbody tr").allTextContents();
await page.screenshot({ path: `${folder}/swap-${theme}.png` });
console.log(JSON.stringify(seen));
await browser.close();
