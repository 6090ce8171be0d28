/** A policy that plays, as segar.policies.NetworkPolicy acts in one environment, to the bit. */

import { Machine } from "segar/machine.js";

export class Policy {
  /** Load the module of a policy; see segar.playground.policy. */
  static async load(about, blob) {
    return new Policy(about, await Machine.load(about.module, blob));
  }

  constructor(about, machine) {
    this.about = about;
    this.machine = machine;
    this.value = null;
  }

  /** Forget the past, because an episode starts. */
  begin() {
    this.machine.array("memory").fill(0);
    this.machine.array("tick").fill(0n);
    this.value = null; // the return that the critic expects of what was seen last, where the network has one
  }

  /** The action of the next step of the episode in a world; to be asked for once in each step. */
  action(world) {
    const { machine } = this;
    machine.array("observations").set(world.observe(0));
    machine.array("key").set(world.machine.array("key"));
    machine.run("act");
    if (this.about.value) this.value = machine.array("values")[0];
    return machine.array("actions").slice();
  }
}
