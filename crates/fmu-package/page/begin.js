"use strict";

/** Returns the placeholder for the section that runs the FMU, and adds it to a page that has none. */
function space() {
  const found = document.getElementById("live") || document.createElement("div");
  if (!found.isConnected) {
    (document.querySelector("main") || document.body).prepend(found);
  }
  return found;
}

/** Shows why the page cannot run the FMU. @param {Error} error */
function showFailure(error) {
  const paragraph = document.createElement("p");
  paragraph.className = "note";
  paragraph.textContent = `Here this page would run the FMU for you to try, but that is not possible: ${error.message}. The rest of the page is complete.`;
  space().replaceWith(paragraph);
}

/** Decodes base 64 and decompresses the result. @param {string} text */
async function decompress(text) {
  const bytes = Uint8Array.from(atob(text), (character) => character.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate-raw"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/** Runs the other scripts of the page. @param {string} packed */
async function begin(packed) {
  const lacking = ["WebAssembly", "DecompressionStream"].find((name) => !(name in window));
  if (lacking) {
    throw new Error(`this browser has no ${lacking}`);
  }
  const script = document.createElement("script");
  script.textContent = new TextDecoder().decode(await decompress(packed));
  document.body.append(script);
}
