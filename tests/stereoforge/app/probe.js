// Uses the page in the frame as a visitor does, and leaves what it found in the document.
const LONGEST_WAIT_MS = 240000;
const frame = document.querySelector("iframe");
const page = () => frame.contentDocument;
const find = selector => page().querySelector(selector);
const text = selector => (find(selector)?.textContent ?? "").trim();
const visible = selector => Boolean(find(selector)?.getClientRects().length);

async function until(condition, what) {
  const start = Date.now();
  while (!condition()) {
    if (Date.now() - start > LONGEST_WAIT_MS) throw new Error(`waited in vain for ${what}: ${text("#status .said")}`);
    await new Promise(done => setTimeout(done, 100));
  }
}

async function drop(place, name) {
  const remove = find(`#${place} [aria-label="Clear"], #${place} [aria-label="Remove Image"]`);
  if (remove) {
    remove.click();
    await until(() => find(`#${place} input[type=file]`), `an empty ${place}`);
  }
  const bytes = await (await fetch(`/material/${name}`)).blob();
  const view = frame.contentWindow, files = new view.DataTransfer();
  files.items.add(new view.File([bytes], name, { type: "image/png" }));
  const input = find(`#${place} input[type=file]`);
  input.files = files.files;
  input.dispatchEvent(new view.Event("change", { bubbles: true }));
}

const sideways = () => page().documentElement.scrollWidth;
const cut = () => [...page().querySelectorAll("label, button, [data-testid=block-label], .said p")]
  .filter(part => part.getClientRects().length && part.scrollWidth > part.clientWidth + 1 && part.clientWidth > 1
    && frame.contentWindow.getComputedStyle(part).overflowX !== "visible")
  .map(part => part.textContent.trim());

async function pickExample(facts) {
  await until(() => find("#examples img"), "examples");
  facts.emptyWidth = sideways();
  find("#examples img").closest("button").click();
  await until(() => visible("#slider") && page().querySelectorAll("#slider img").length >= 2, "the slider");
  await until(() => ["left", "confidence", "refined"].every(name => find(`#${name} img`)?.naturalWidth), "pictures");
  await until(() => page().querySelectorAll("#files a[href]").length >= 5, "files");
  facts.status = text("#status .said");
  facts.width = sideways();
  facts.cut = cut();
  facts.pictures = [...page().querySelectorAll("#slider img")].map(img => [img.naturalWidth, img.naturalHeight]);
  facts.files = [...page().querySelectorAll("#files a[href]")].map(link => link.href);
  facts.leftOut = text("#left-out");
}

async function readValue(facts) {
  const picture = find("#refined img"), box = picture.getBoundingClientRect();
  picture.dispatchEvent(new frame.contentWindow.MouseEvent("click", {
    bubbles: true, cancelable: true, clientX: box.left + box.width / 2, clientY: box.top + box.height / 2 }));
  await until(() => text("#reading").startsWith("x "), "a reading");
  facts.reading = text("#reading");
}

async function strengthen(facts) {
  const before = find("#refined img").src;
  [...page().querySelectorAll("#strength input")].at(-1).click();
  await until(() => find("#refined img") && find("#refined img").src !== before, "another strength");
  facts.strengthened = text("#status .said");
}

async function dropAll(facts) {
  await drop("left-input", "left.png");
  await drop("right-input", "small.png");
  await until(() => text("#status .said").includes("120x64"), "the sentence about sizes");
  facts.sizes = text("#status .said");
  facts.sizesAlert = visible("#status [role=alert]") && !visible("#results");
  await drop("left-input", "broken.png");
  await until(() => text("#status .said").includes("broken.png"), "the sentence about a broken picture");
  facts.broken = text("#status .said");
  facts.brokenAlert = visible("#status [role=alert]") && !visible("#results");
  await drop("left-input", "left.png");
  await drop("right-input", "right.png");
  await until(() => text("#status .said").startsWith("128x64") && visible("#results"), "the dropped pair");
  facts.droppedLeftOut = text("#left-out");
}

async function probe() {
  const facts = {};
  frame.contentWindow.performance.setResourceTimingBufferSize(9999); // 250 is the usual end of the list
  try {
    await pickExample(facts);
    if (ALL) {
      await readValue(facts);
      await strengthen(facts);
      await dropAll(facts);
    }
    facts.loaded = frame.contentWindow.performance.getEntriesByType("resource").map(entry => entry.name);
  } catch (error) {
    facts.error = String(error);
  }
  document.querySelector("script").remove(); // its text has the marks of the facts, too
  const note = document.createElement("pre");
  note.hidden = true;
  note.textContent = "FACTS" + JSON.stringify(facts) + "END";
  document.body.append(note);
  await fetch("/done");
}
frame.addEventListener("load", probe, { once: true });
