# cpbench.jl: a solver in Julia for cpbench. Needs the packages JSON and NPZ; the only other file is yours.
#
# cpbench starts the program once and talks to it in lines of JSON: hello, load, warmup, solve, write, quit. Only
# `solve` is timed, so that Julia's compiler is not, as long as the warm-up calls what a solve calls.
module CPBench

using JSON, NPZ

export serve, Unsupported, NoLicence

"Throw this error if the solver cannot take the problem; the row of the run says so."
struct Unsupported <: Exception
    why::String
end

"Throw this error if a licence does not let the solver run; the row of the run has the reason."
struct NoLicence <: Exception
    why::String
end

"""
    serve(solve, name, version; warmup = () -> nothing)

Serve until cpbench is done.

`solve(problem, request)` gets the arrays of the problem by the names of the formulation (`problem["M"]`, dense, rows
first; unless the declaration has `matrices = "dense"`, a sparse matrix is `problem["M.data"]`, `"M.indices"`,
`"M.indptr"` and `"M.shape"`, counted from 0). The request has `request.tolerance`, `.seconds`, `.iterations`,
`.seed`, `.options` (by name) and `.start` (an answer by name, or nothing). It returns
`(claim = "solved", point = Dict("z" => z), iterations = 12, message = "")`; claims are solved, inaccurate,
infeasible, unbounded, max_iter and failed.
"""
function serve(solve, name, version; warmup = () -> nothing)
    out = stdout               # Julia keeps a duplicate of it for the protocol,
    redirect_stdout(stderr)    # and text printed from here on goes into the log of the run
    problem = Dict{String,Any}()
    point = Dict{String,Vector{Float64}}()
    for line in eachline(stdin)
        asked = JSON.parse(line)
        what = asked["do"]
        what == "quit" && break
        reply = try
            fields = Dict{String,Any}("ok" => true)
            if what == "hello"
                merge!(fields, Dict("name" => name, "version" => version))
            elseif what == "load"
                problem = arrays(asked["problem"])
            elseif what == "warmup"
                warmup()
            elseif what == "solve"
                answer = solve(problem, request(asked))
                point = answer.point
                for key in (:claim, :iterations, :message)
                    fields[String(key)] = answer[key]
                end
            elseif what == "write"
                for (name, value) in point
                    npzwrite(joinpath(asked["answer"], name * ".npy"), value)
                end
            end
            fields
        catch failure
            error_reply(failure)
        end
        println(out, JSON.json(reply))
        flush(out)
    end
end

"The arrays of a folder, by name."
arrays(folder) = Dict{String,Any}(
    first(splitext(file)) => npzread(joinpath(folder, file)) for file in readdir(folder) if endswith(file, ".npy")
)

request(asked) = (
    tolerance = Float64(asked["tolerance"]),
    seconds = Float64(something(asked["seconds"], Inf)),           # null is infinity
    iterations = something(asked["iterations"], typemax(Int)),
    seed = asked["seed"],
    options = asked["options"],
    start = asked["start"] === nothing ? nothing : arrays(asked["start"]),
)

error_reply(failure::Unsupported) = Dict("unsupported" => failure.why)
error_reply(failure::NoLicence) = Dict("unavailable" => failure.why, "state" => "licence")
error_reply(failure::OutOfMemoryError) = Dict("memory" => "out of memory")
error_reply(failure) = Dict("error" => sprint(showerror, failure))

end
