// The monitor's page in a browser that needs no graphics card. What goes wrong in it is kept.
import { chromium } from "playwright-core";

export const kPatience = 120_000; // ms

export async function open(executablePath, theme, url) {
  const browser = await chromium.launch({
    executablePath,
    args: ["--no-sandbox", "--no-first-run", "--disable-dev-shm-usage", "--disable-sync",
      "--disable-background-networking", "--disable-component-update", "--use-gl=angle",
      "--use-angle=swiftshader", "--enable-unsafe-swiftshader"],
  });
  const page = await browser.newPage({
    viewport: { width: 1000, height: 640 }, colorScheme: theme });
  page.setDefaultTimeout(kPatience);
  const errors = [];
  page.on("pageerror", (error) => errors.push(error.message));
  page.on("console", (message) => {
    if (message.type() === "error") errors.push(message.text());
  });
  await page.goto(url);
  return { browser, page, errors };
}
