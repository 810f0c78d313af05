// What the page holds: a JSON object, and blobs of deflated bytes in base64.

export const facts = JSON.parse(document.getElementById("facts").textContent);

/** Bytes of a blob. */
export async function blob(number) {
  const text = document.getElementById(`b${number}`).textContent;
  const packed = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/** Numbers whose differences a blob holds: bytes of all values apart, lowest first. */
export async function integers(number, width) {
  const bytes = await blob(number);
  const count = bytes.length / width;
  const values = new Uint32Array(count);
  for (let i = 0, last = 0; i < count; ++i) {
    let code = 0;
    for (let k = 0; k < width; ++k) code |= bytes[k * count + i] << (8 * k);
    last += (code >>> 1) ^ -(code & 1);
    values[i] = last;
  }
  return values;
}

/** Frames of points: (frames, points, 3) 16-bit fractions of a box, each frame less the one before. */
export async function pointFrames(item, frames) {
  const bytes = await blob(item.points);
  const each = 3 * item.point_count;
  const count = item.still ? 1 : frames;
  const result = [];
  let last = new Uint16Array(each);
  for (let f = 0; f < count; ++f) {
    const now = new Uint16Array(each);
    const at = 2 * f * each;
    for (let i = 0; i < each; ++i) now[i] = last[i] + (bytes[at + i] | (bytes[at + each + i] << 8));
    result.push(now);
    last = now;
  }
  return result;
}

/** Square roots of a frame's densities, 0 to 255. */
export async function density(frame, cells) {
  const values = await blob(frame.blob);
  const [nx, ny, nz] = cells;
  for (let row = 0; row < ny * nz; ++row) {
    for (let i = row * nx + 1; i < (row + 1) * nx; ++i) values[i] += values[i - 1];
  }
  return values;
}
