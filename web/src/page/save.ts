// Pictures and films as files.

import { ArrayBufferTarget, Muxer } from "webm-muxer";
import { download } from "./dom";
import { Problem } from "../problem";
import type { Viewer } from "../viewer";

const CODECS = [
  ["vp09.00.40.08", "V_VP9"],
  ["vp8", "V_VP8"],
] as const;
const BITRATE = 12e6;
const KEY = 24; // frames between those that stand alone

/** As large as it is seen, in even numbers of pixels, as encoders want them. */
function size({ canvas }: Viewer): [number, number] {
  const even = (value: number): number => 2 * Math.max(Math.round(value / 2), 8);
  return [even(canvas.width), even(canvas.height)];
}

async function pixels(viewer: Viewer, width: number, height: number): Promise<ImageData> {
  return new ImageData(await viewer.stage.pixels(width, height), width, height);
}

/** What is seen, as a PNG. */
export async function picture(viewer: Viewer): Promise<Blob> {
  const [width, height] = size(viewer);
  const canvas = new OffscreenCanvas(width, height);
  canvas.getContext("2d")!.putImageData(await pixels(viewer, width, height), 0, 0);
  return canvas.convertToBlob({ type: "image/png" });
}

/** The whole sequence from its beginning, every frame of it, however long each takes: WebM. */
export async function film(viewer: Viewer, progress: (done: number) => void): Promise<Blob> {
  if (!("VideoEncoder" in globalThis)) throw new Problem("This browser encodes no films.");
  const [width, height] = size(viewer);
  const framerate = viewer.smoke.fps * viewer.speed;
  const [codec, name] = await chosen(width, height, framerate);
  const target = new ArrayBufferTarget();
  const video = { codec: name, width, height, frameRate: framerate };
  const muxer = new Muxer({ target, video });
  let failure: Error | null = null;
  const encoder = new VideoEncoder({
    output: (chunk, about) => muxer.addVideoChunk(chunk, about),
    error: (error) => (failure = error),
  });
  encoder.configure({ codec, width, height, framerate, bitrate: BITRATE });
  for (let at = 0; at < viewer.smoke.length; at++) {
    if (at === 0) await viewer.restart();
    else await viewer.goTo(at);
    const timestamp = Math.round((1e6 * at) / framerate);
    const given = await pixels(viewer, width, height);
    const frame = new VideoFrame(given.data, {
      format: "RGBA",
      codedWidth: width,
      codedHeight: height,
      timestamp,
      duration: Math.round(1e6 / framerate),
    });
    encoder.encode(frame, { keyFrame: at % KEY === 0 });
    frame.close();
    if (failure !== null) throw failure;
    progress((at + 1) / viewer.smoke.length);
  }
  await encoder.flush();
  muxer.finalize();
  return new Blob([target.buffer], { type: "video/webm" });
}

async function chosen(
  width: number,
  height: number,
  framerate: number,
): Promise<(typeof CODECS)[number]> {
  for (const each of CODECS) {
    const asked = { codec: each[0], width, height, framerate, bitrate: BITRATE };
    if ((await VideoEncoder.isConfigSupported(asked)).supported) return each;
  }
  throw new Problem("This browser encodes no WebM films.");
}

export function save(content: Blob, viewer: Viewer, kind: string): void {
  const name = viewer.names.filter(Boolean).join("_");
  const frame = kind === "png" ? `_${viewer.smoke.number(Math.max(viewer.stage.at, 0))}` : "";
  download(content, `${viewer.smoke.name}_${name}${frame}.${kind}`.replace(/[^\w.-]+/g, "_"));
}
