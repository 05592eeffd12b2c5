"""The product of `block_row` in vector registers, as code for LLVM.

Compilers keep the three sums of a row in scalars, one multiplication at a time. Here a block lies by columns, so that
u += x₀·(column 0) + x₁·(column 1) + x₂·(column 2) is three multiply-adds of four lanes, each with its own sum;
the fourth lane reads on into the next column and is never looked at. That is why `blocks` has a number more
than it needs. On processors with narrower registers LLVM splits the lanes.
"""

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

LANES = 4
_DOUBLE = ir.DoubleType()
_VECTOR = ir.VectorType(_DOUBLE, LANES)
_INDEX = ir.IntType(64)


@intrinsic
def row_product(typingctx, first, last, column, blocks, r):
    """Return (u0, u1, u2) = Σ_k B_k r[column_k] over first ≤ k < last.

    first, last : uint64. column : uint32 array. r : float64 array, all contiguous. blocks : 9 numbers each, column
    after column, and one more in the end.
    """
    signature = types.UniTuple(types.float64, 3)(first, last, column, blocks, r)

    def codegen(context, builder, signature, arguments):
        first, last, *arrays = arguments
        columns, blocks, r = (
            context.make_array(kind)(context, builder, value).data
            for kind, value in zip(signature.args[2:], arrays, strict=True)
        )

        def constant(value):
            return ir.Constant(_INDEX, value)

        def lanes(x):
            # LLVM turns an insertion and a shuffle into one broadcast
            one = builder.insert_element(ir.Constant(_VECTOR, ir.Undefined), x, ir.Constant(ir.IntType(32), 0))
            return builder.shuffle_vector(one, one, ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES))

        # three chains of additions: one would wait four cycles for each block
        sums = [cgutils.alloca_once_value(builder, ir.Constant(_VECTOR, [0.0] * LANES)) for _ in range(3)]
        with cgutils.for_range_slice(builder, first, last, constant(1), _INDEX) as (k, _):
            j = builder.zext(builder.load(builder.gep(columns, [k])), _INDEX)
            x = builder.gep(r, [builder.mul(j, constant(3))])
            block = builder.gep(blocks, [builder.mul(k, constant(9))])
            for c in range(3):
                # columns begin at multiples of three numbers: loads are not aligned to 32 bytes
                at = builder.bitcast(builder.gep(block, [constant(3 * c)]), _VECTOR.as_pointer())
                factor = lanes(builder.load(builder.gep(x, [constant(c)])))
                product = builder.fmul(builder.load(at, align=8), factor, flags=("contract",))
                builder.store(builder.fadd(builder.load(sums[c]), product, flags=("contract",)), sums[c])
        total = builder.fadd(builder.fadd(builder.load(sums[0]), builder.load(sums[1])), builder.load(sums[2]))
        parts = [builder.extract_element(total, ir.Constant(ir.IntType(32), c)) for c in range(3)]
        return context.make_tuple(builder, signature.return_type, parts)

    return signature, codegen


@intrinsic
def fetch(typingctx, array, index):
    """Have the cache line of array[index] brought as near as the second level; any index may be asked for.

    array : float64, contiguous. index : uint64.
    """
    signature = types.void(array, index)

    def codegen(context, builder, signature, arguments):
        base = context.make_array(signature.args[0])(context, builder, arguments[0]).data
        byte, hint = ir.IntType(8).as_pointer(), ir.IntType(32)
        wanted = builder.bitcast(builder.gep(base, [arguments[1]]), byte)
        kind = ir.FunctionType(ir.VoidType(), [byte, hint, hint, hint])
        llvm = cgutils.get_or_insert_function(builder.module, kind, "llvm.prefetch.p0i8")
        read, second_level, data = (ir.Constant(hint, value) for value in (0, 2, 1))
        builder.call(llvm, [wanted, read, second_level, data])
        return context.get_dummy_value()

    return signature, codegen
