// The loop: what is shown on the canvas, when, and how finely; and what a user can do with it.

import type { Camera } from "./picture/camera";
import { Gpu } from "./gpu/gpu";
import { pinholeMoved } from "./page/gestures";
import { readModel, type Rule } from "./automaton/model";
import { say, stop } from "./page/notice";
import { oneLine, Problem } from "./problem";
import { bytesOf, type Show } from "./page/show";
import { Smoke } from "./smoke/smoke";
import { DEFAULTS, type Settings } from "./settings";
import { Stage } from "./stage";

export type Tool = "orbit" | "erase" | "more" | "less";

/** Milliseconds that a picture may take, and from which it could be finer. */
const SLOW = 15;
const QUICK = 9;
const COARSEST = 0.3;
/** Milliseconds without a change after which the picture is made as fine as it can be. */
const SETTLE = 250;
/** How much farther than a film's the camera stands, and how much higher the smoke, for buttons. */
const ROOM = 1.22;
const RAISED = 0.07;
/** What a rule is told. */
const TOLD: (keyof Settings)[] = ["guide", "guideAzimuth", "guideElevation"];

export class Viewer extends EventTarget {
  gpu!: Gpu;
  stage!: Stage;
  isPlaying = false;
  /** Whether the rule goes on working while no frame passes. */
  isAlive = true;
  speed = 1;
  tool: Tool = "orbit";
  names: [string, string] = ["", ""];
  /** Part of the screen's pixels along each axis that are computed. */
  fineness = 1;
  /** How long pictures take of late, ms. */
  took = 0;
  private context!: GPUCanvasContext;
  private isDirty = true;
  private isSettled = false;
  private lastChange = 0;
  private due = 0;
  private isBusy = false;
  private waiting = 0;
  private isClosed = false;
  private readonly rules = new Map<string, Rule>();

  private constructor(
    readonly canvas: HTMLCanvasElement,
    readonly show: Show,
    readonly smoke: Smoke,
  ) {
    super();
  }

  static async open(canvas: HTMLCanvasElement, show: Show): Promise<Viewer> {
    const viewer = new Viewer(canvas, show, await Smoke.open(show.smoke));
    await viewer.start();
    new ResizeObserver(() => viewer.resized()).observe(canvas);
    requestAnimationFrame(viewer.tick);
    return viewer;
  }

  /** Open the GPU; again where it was lost. */
  private async start(): Promise<void> {
    this.gpu = await Gpu.open();
    const format = navigator.gpu.getPreferredCanvasFormat();
    const context = this.canvas.getContext("webgpu");
    if (context === null) throw new Problem("This browser gives WebGPU no canvas.");
    this.context = context;
    context.configure({ device: this.gpu.device, format, alphaMode: "opaque" });
    this.gpu.device.addEventListener("uncapturederror", (event) => {
      say(`The GPU complains: ${oneLine((event as GPUUncapturedErrorEvent).error.message)}`);
    });
    this.stage = await Stage.create(this.gpu, this.smoke, format);
    this.reframe();
    void this.gpu.lost.then((info) => this.recover(info));
  }

  private async recover(info: GPUDeviceLostInfo): Promise<void> {
    if (this.isClosed) return;
    const { settings, camera, at } = this.stage;
    say("The GPU was lost; the page begins again.");
    try {
      await this.start();
      Object.assign(this.stage.settings, settings);
      this.stage.camera = camera;
      await this.use(this.names[0], 0);
      if (this.names[1]) await this.use(this.names[1], 1);
      await this.goTo(Math.max(at, 0));
      this.dispatchEvent(new Event("recovered"));
    } catch (error) {
      stop("The GPU is gone", `${oneLine(error)} ${info.message}`);
    }
  }

  close(): void {
    this.isClosed = true;
    this.gpu.device.destroy();
  }

  get aspect(): number {
    return (this.canvas.clientWidth || 1) / (this.canvas.clientHeight || 1);
  }

  private resized(): void {
    this.changed();
  }

  /** Something is to be seen anew. */
  changed(): void {
    this.isDirty = true;
    this.isSettled = false;
    this.lastChange = performance.now();
    this.dispatchEvent(new Event("change"));
  }

  /** The rule of a name, read when it is first asked for. */
  private async rule(name: string): Promise<Rule> {
    let rule = this.rules.get(name);
    if (rule === undefined) {
      const shown = this.show.rules.find((each) => each.name === name);
      if (shown === undefined) throw new Problem(`There is no rule '${name}' here.`);
      rule = readModel(await bytesOf(shown.model), name);
      this.rules.set(name, rule);
    }
    return rule;
  }

  /** Let a rule paint, as the first or as the one that is mixed with it; "" ends mixing. */
  async use(name: string, place: 0 | 1): Promise<void> {
    const rule = name === "" ? null : await this.rule(name);
    await this.exclusively(() => this.stage.use(rule, place));
    this.names[place] = name;
    if (place === 1 && name !== "" && this.stage.settings.mix === 0) this.set("mix", 0.5);
    this.changed();
    this.dispatchEvent(new Event("rules"));
  }

  /** A rule from a file of the user's own. */
  async add(file: File): Promise<void> {
    const rule = readModel(await file.arrayBuffer(), file.name);
    this.rules.set(file.name, rule);
    this.show.rules.unshift({ name: file.name, title: rule.title, model: "" });
    await this.use(file.name, 0);
  }

  /** The first rule as a training has it now. */
  async learned(bytes: ArrayBuffer): Promise<void> {
    const name = this.names[0];
    const rule = readModel(bytes, name);
    this.rules.set(name, rule);
    const [layer] = this.stage.layers;
    if (!layer?.learn(rule)) await this.use(name, 0);
    this.changed();
  }

  set<K extends keyof Settings>(name: K, value: Settings[K]): void {
    this.stage.settings[name] = value;
    if (TOLD.includes(name)) this.stage.conditionAgain();
    if (name === "half") this.names.forEach((each, at) => void this.use(each, at as 0 | 1));
    this.stage.lookAgain();
    this.changed();
  }

  get defaults(): Readonly<Settings> {
    return DEFAULTS;
  }

  isDefault(name: keyof Settings): boolean {
    return this.stage.settings[name] === (this.show.settings[name] ?? DEFAULTS[name]);
  }

  /** Nothing else touches the stage while this runs. */
  private async exclusively(work: () => Promise<void>): Promise<void> {
    this.waiting++; // the next picture lets it pass, however slow pictures are
    while (this.isBusy) await new Promise((done) => setTimeout(done, 5));
    this.waiting--;
    this.isBusy = true;
    try {
      await work();
    } finally {
      this.isBusy = false;
    }
  }

  async goTo(at: number): Promise<void> {
    const place = Math.min(Math.max(at, 0), this.smoke.length - 1);
    await this.exclusively(() => this.stage.show(place));
    this.changed();
  }

  async restart(): Promise<void> {
    await this.exclusively(() => this.stage.restart());
    this.changed();
  }

  async play(): Promise<void> {
    if (this.stage.at === this.smoke.length - 1) await this.restart();
    this.isPlaying = true;
    this.due = performance.now();
    this.changed();
  }

  pause(): void {
    this.isPlaying = false;
    this.changed();
  }

  look(change: (camera: Camera) => void): void {
    change(this.stage.camera);
    this.changed();
  }

  /** The smoke of all frames between what lies over the canvas. */
  reframe(): void {
    const camera = this.stage.framed(this.aspect);
    camera.distance *= ROOM;
    pinholeMoved(camera, 0, RAISED);
    this.stage.camera = camera;
    this.changed();
  }

  move(x: number, y: number): void {
    this.look((camera) => pinholeMoved(camera, x, y));
  }

  /** Touch the smoke at a place of the canvas, 0 … 1 from the top left. */
  async touch(x: number, y: number): Promise<void> {
    const { tool } = this;
    if (tool === "orbit") return;
    if (tool !== "erase" && this.stage.layers.length < 2) {
      say("Choose a second style to brush it on.");
      return;
    }
    await this.exclusively(async () => this.stage.touch(tool, [x - 0.5, 0.5 - y], this.aspect));
    this.changed();
  }

  private readonly tick = async (now: number): Promise<void> => {
    if (this.isClosed) return;
    requestAnimationFrame((later) => void this.tick(later));
    const isTaken = this.isBusy || this.waiting > 0;
    if (isTaken || document.hidden || this.stage.layers.length === 0) return;
    this.isBusy = true;
    try {
      await this.frame(now);
    } catch (error) {
      this.isPlaying = false;
      say(oneLine(error));
    } finally {
      this.isBusy = false;
    }
  };

  private async frame(now: number): Promise<void> {
    const begun = performance.now();
    if (this.isPlaying && now >= this.due) {
      await this.advance(now);
    } else if (this.isAlive && !this.isPlaying && !this.isSettled && this.stage.at >= 0) {
      this.stage.step(1);
      this.isDirty = true;
    }
    const isStill = now - this.lastChange > SETTLE && !this.isPlaying;
    if (!this.isDirty && (this.isSettled || !isStill)) return;
    this.isDirty = false;
    this.draw(isStill ? 1 : this.fineness);
    this.isSettled = isStill && !this.isAlive;
    await this.gpu.device.queue.onSubmittedWorkDone();
    if (!isStill) this.adapt(performance.now() - begun);
  }

  private async advance(now: number): Promise<void> {
    const next = this.stage.at + 1;
    if (next >= this.smoke.length) {
      this.isPlaying = false;
      this.dispatchEvent(new Event("ended"));
      this.changed();
      return;
    }
    const late = now - this.due;
    const pace = 1000 / (this.smoke.fps * this.speed);
    this.due = late > pace ? now + pace : this.due + pace;
    await this.stage.show(next);
    this.isDirty = true;
    this.dispatchEvent(new Event("frame"));
  }

  private draw(fineness: number): void {
    const ratio = window.devicePixelRatio || 1;
    const most = this.gpu.device.limits.maxTextureDimension2D;
    const width = Math.min(Math.max(Math.round(this.canvas.clientWidth * ratio), 1), most);
    const height = Math.min(Math.max(Math.round(this.canvas.clientHeight * ratio), 1), most);
    if (this.canvas.width !== width || this.canvas.height !== height) {
      [this.canvas.width, this.canvas.height] = [width, height];
    }
    const picture = this.stage.take(
      Math.max(Math.round(width * fineness), 16),
      Math.max(Math.round(height * fineness), 16),
    );
    this.stage.present(picture, this.context.getCurrentTexture().createView(), width, height);
  }

  /** Coarser where pictures come late, finer where there is time. */
  private adapt(took: number): void {
    this.took = this.took === 0 ? took : 0.8 * this.took + 0.2 * took;
    if (this.took > SLOW) {
      if (this.fineness > COARSEST) this.fineness = Math.max(this.fineness * 0.92, COARSEST);
      else this.stage.samples = 1;
    } else if (this.took < QUICK) {
      if (this.stage.samples === 1) this.stage.samples = 0;
      else this.fineness = Math.min(this.fineness * 1.04, 1);
    }
  }
}
