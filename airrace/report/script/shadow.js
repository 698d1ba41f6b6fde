// Shadows on the ground: shapes laid flat along the sun's rays, each spot darkened once.

import { Group, Matrix4, Mesh, MeshBasicMaterial, NotEqualStencilFunc, ReplaceStencilOp } from "three";

const DARK = 0.34;
const NUMBER = 254; // in the stencil, of all shadows

/** A material that paints no spot twice, however its triangles overlap. */
export function once(material, number) {
  const stencil = { stencilWrite: true, stencilRef: number, stencilFunc: NotEqualStencilFunc };
  return Object.assign(material, stencil, { stencilZPass: ReplaceStencilOp });
}

/** The shadow of an object with all its parts; `follow()` moves it after the object has been moved. */
export function shadowOf(object, sun) {
  const look = { color: "#04121c", transparent: true, opacity: DARK, depthWrite: false };
  const material = once(new MeshBasicMaterial(look), NUMBER);
  const group = new Group();
  const flat = new Matrix4().set(1, -sun.x / sun.y, 0, 0, 0, 0, 0, 0, 0, -sun.z / sun.y, 1, 0, 0, 0, 0, 1);
  const pairs = [];
  object.traverse((part) => {
    if (!part.isMesh || part.material.opacity < 0.3) return;
    const mesh = new Mesh(part.geometry, material);
    Object.assign(mesh, { matrixAutoUpdate: false, frustumCulled: false, renderOrder: -6 });
    pairs.push([mesh, part]);
    group.add(mesh);
  });
  group.follow = () => {
    object.updateMatrixWorld(true);
    for (const [mesh, part] of pairs) mesh.matrix.multiplyMatrices(flat, part.matrixWorld);
  };
  group.follow();
  return group;
}
