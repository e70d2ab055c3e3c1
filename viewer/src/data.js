// Reads the data that the page carries: JSON, zlib, base64; in it long arrays as base64 of little-endian numbers.

/** The page's data. */
export async function pageData() {
  if (!("DecompressionStream" in window)) throw new Error("it needs a browser of 2023 or later, with DecompressionStream");
  const json = new TextDecoder().decode(await unfold(document.getElementById("report-data").textContent.trim()));
  const data = JSON.parse(json);
  const executed = (data.contact_maps ?? []).flatMap(({ maps }) => maps.map((map) => map.executed));
  for (const figure of [...(data.rollouts ?? []), ...executed]) {
    // The long texts of motions stand in a list of their own, as many are the same.
    for (const name of figure ? ["bodies", "motion", "forces"] : []) figure.rollout[name] = data.texts[figure.rollout[name]];
  }
  return data;
}

/** base64 → bytes. */
export function unpackBytes(text) {
  const raw = atob(text ?? "");
  const out = new Uint8Array(raw.length);
  for (let i = 0; i < raw.length; i++) out[i] = raw.charCodeAt(i);
  return out;
}

/** base64 of zlib → bytes, with what the browser has for it. */
export async function unfold(text) {
  const stream = new Blob([unpackBytes(text)]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/** base64 → 32-bit floats (the packer writes them little-endian, whatever the machine). */
export function unpackFloats(text) {
  const raw = unpackBytes(text);
  const view = new DataView(raw.buffer);
  const out = new Float32Array(raw.length >> 2);
  for (let i = 0; i < out.length; i++) out[i] = view.getFloat32(4 * i, true);
  return out;
}
